//! The ring from above, the robot's front up: a ray per sensor, as long as its range.

use crate::monitor::canvas::Window;
use crate::monitor::dashboard::{Beam, BeamState, Dashboard};
use crate::monitor::view::Look;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};
use ratatui::widgets::canvas::{Context, Line};
use slamd_core::{Point, Pose2};
use std::f64::consts::FRAC_PI_2;

/// A ray without a length is drawn this long, as a part of the greatest range.
const STUB: f64 = 0.15;
/// The picture reaches beyond the greatest range by this factor: there is room for the sensors' numbers.
const RIM: f64 = 1.15;
/// The inner row of numbers, as a part of the greatest range.
const INNER: f64 = 0.8;

/// The last sweep. A faulty sensor has its number at the rim, a silent one a question mark.
pub(super) fn draw(area: Rect, buffer: &mut Buffer, dashboard: &Dashboard, look: Look) {
    let beams: Vec<Beam> = dashboard.beams().collect();
    if beams.is_empty() {
        let words = "no ring is known yet";
        let x = area.x + area.width.saturating_sub(20) / 2;
        buffer.set_stringn(x, area.y + area.height / 2, words, usize::from(area.width), look.faint());
        return;
    }
    let reach_m = beams.iter().map(|beam| beam.robot_from_sensor.position().coords.norm()).fold(0.0, f64::max)
        + dashboard.max_range_m;
    let side_m = 2.0 * RIM * reach_m;
    let dot_m = Window::fitting(area, side_m, side_m);
    let window = Window::new(area, Point::origin(), dot_m);
    // What matters more is drawn later, over the rest.
    window.draw(buffer, look.marker('*'), |canvas| {
        for state in [BeamState::Healthy, BeamState::Silent, BeamState::Faulty] {
            for beam in beams.iter().filter(|beam| beam.state == state) {
                ray(canvas, beam, dashboard.max_range_m, look);
            }
        }
    });
    for (sensor, beam) in beams.iter().enumerate() {
        let rim = UP * beam.robot_from_sensor;
        // Numbers of neighbours stand in two rows, so that they do not hide each other.
        let from_centre_m = reach_m * if sensor % 2 == 0 { 0.5 * (1.0 + RIM) } else { INNER };
        let at = Point::from(rim.ahead(1.0) - rim.position()) * from_centre_m;
        match beam.state {
            BeamState::Healthy => {}
            BeamState::Silent => window.label(buffer, at, "?", look.ink(Color::Yellow)),
            BeamState::Faulty => {
                let style = look.ink(Color::Red).add_modifier(Modifier::BOLD | Modifier::REVERSED);
                window.label(buffer, at, &sensor.to_string(), style);
            }
        }
    }
    let front = if look.unicode { "▲" } else { "^" };
    window.label(buffer, Point::origin(), front, look.ink(Color::Cyan).add_modifier(Modifier::BOLD));
}

/// `screen_from_robot`: the robot's x axis is the screen's y axis.
const UP: Pose2 = Pose2 { x_m: 0.0, y_m: 0.0, theta_rad: FRAC_PI_2 };

fn ray(canvas: &mut Context<'_>, beam: &Beam, max_range_m: f64, look: Look) {
    let has_range = beam.range_m.is_finite();
    let is_clear = beam.range_m.is_infinite() && beam.range_m > 0.0;
    let length_m = if has_range || is_clear { beam.range_m.min(max_range_m) } else { STUB * max_range_m };
    let (ascii, colour) = match beam.state {
        BeamState::Faulty => ('x', Color::Red),
        BeamState::Silent => ('?', Color::Yellow),
        BeamState::Healthy if has_range => ('*', Color::Green),
        BeamState::Healthy => ('.', Color::Blue),
    };
    if !look.unicode {
        canvas.marker(look.marker(ascii));
    }
    let screen_from_sensor = UP * beam.robot_from_sensor;
    let (from, to) = (screen_from_sensor.position(), screen_from_sensor.ahead(length_m));
    canvas.draw(&Line::new(from.x, from.y, to.x, to.y, look.colour(colour)));
}

/// How many are of which state, for the frame.
pub(super) fn census(dashboard: &Dashboard) -> String {
    let count = |state| dashboard.beams().filter(|beam| beam.state == state).count();
    let (healthy, faulty, silent) = (count(BeamState::Healthy), count(BeamState::Faulty), count(BeamState::Silent));
    format!("ok {healthy} bad {faulty} silent {silent}")
}
