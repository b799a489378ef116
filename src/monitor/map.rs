//! The map, small: walls as dots, known floor as faint points, the path, the robot as an arrow.

use crate::monitor::canvas::{Dots, Window};
use crate::monitor::dashboard::Dashboard;
use crate::monitor::view::{Look, View};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};
use ratatui::symbols::Marker;
use ratatui::widgets::canvas::Line;
use ratatui::widgets::{Paragraph, Widget as _, Wrap};
use slamd_core::{Point, Pose2, Raster};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Cells from this percentage on are walls, up to the other one floor: the thresholds of ROS's `map_server`.
const WALL: i8 = 65;
const FLOOR: i8 = 25;
/// Before anything is known, this much is shown, metres.
const FIRST_M: f64 = 4.0;
/// The scale changes in steps, so that a growing map does not jitter.
const STEP: f64 = 1.189_207_115_002_721;
/// One step of the zoom.
const ZOOM: f64 = std::f64::consts::SQRT_2;

/// The part of the map that is shown: its middle, and the size of a dot in metres.
pub(super) fn window(area: Rect, dashboard: &Dashboard, view: View) -> (Point, f64) {
    let robot = dashboard.session.estimate.map(|estimate| estimate.pose.position()).unwrap_or_default();
    let (low, high) = dashboard.plan.known.unwrap_or((robot, robot));
    let (width_m, height_m) = ((high.x - low.x).max(FIRST_M), (high.y - low.y).max(FIRST_M));
    let steps = libm::ceil(libm::log(Window::fitting(area, width_m, height_m)) / libm::log(STEP));
    let dot_m = libm::pow(STEP, steps) * libm::pow(ZOOM, -f64::from(view.zoom));
    let centre = if view.follow { robot } else { nalgebra::center(&low, &high) };
    let whole = |metres: f64| dot_m * libm::round(metres / dot_m);
    (Point::new(whole(centre.x), whole(centre.y)), dot_m)
}

/// The map about its middle or about the robot: faint points where the floor is known, the path, walls over them, then the robot. Without a
/// map, the reason.
pub(super) fn draw(area: Rect, buffer: &mut Buffer, dashboard: &Dashboard, view: View, look: Look) {
    let (centre, dot_m) = window(area, dashboard, view);
    let window = Window::new(area, centre, dot_m);
    let (mut walls, mut floor) = (Vec::new(), Vec::new());
    for (dot, point) in window.dots() {
        match highest(&dashboard.plan.raster, point, dot_m) {
            WALL.. => walls.push(dot),
            0..=FLOOR => floor.push(dot),
            _ => {}
        }
    }
    let floor_marker = Marker::Custom(if look.unicode { '·' } else { '.' });
    let layers = [(floor, floor_marker, Color::DarkGray), (walls, look.marker('#'), Color::White)];
    if let Some(reason) = dashboard.no_map() {
        let words = Paragraph::new(look.text(&reason)).style(look.faint()).wrap(Wrap { trim: true });
        return words.render(area, buffer);
    }
    for (dots, marker, colour) in layers {
        let dots = Dots { dots: &dots, marker, colour: look.colour(colour) };
        window.draw(buffer, marker, |canvas| canvas.draw(&dots));
    }
    window.draw(buffer, look.marker('+'), |canvas| {
        for ends in dashboard.track.points().windows(2) {
            canvas.draw(&Line::new(ends[0].x, ends[0].y, ends[1].x, ends[1].y, look.colour(Color::Blue)));
        }
    });
    if let Some(estimate) = &dashboard.session.estimate {
        let style = look.ink(Color::Cyan).add_modifier(Modifier::BOLD);
        window.label(buffer, estimate.pose.position(), arrow(estimate.pose, look), style);
    }
}

/// A bar in columns of the screen and its length, round and at most a third of the map's width.
pub(super) fn scale_bar(area: Rect, dashboard: &Dashboard, view: View, look: Look) -> String {
    let (_, dot_m) = window(area, dashboard, view);
    let column_m = 2.0 * dot_m;
    let most_m = column_m * f64::from(area.width) / 3.0;
    let lengths_m = [50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1];
    let length_m = lengths_m.into_iter().find(|length_m| *length_m <= most_m).unwrap_or(0.05);
    let columns = index(libm::round(length_m / column_m), usize::from(area.width)).max(2);
    let [left, middle, right] = if look.unicode { ["├", "─", "┤"] } else { ["|", "-", "|"] };
    format!("{left}{}{right} {length_m} m", middle.repeat(columns - 2))
}

/// The most occupied of the map's cells under a dot; unknown where none is known.
fn highest(raster: &Raster, point: Point, dot_m: f64) -> i8 {
    if raster.occupancy.is_empty() {
        return Raster::UNKNOWN;
    }
    let span = |middle: f64, origin: f64, count: usize| {
        let first = libm::floor((middle - 0.5 * dot_m - origin) / raster.cell_m + ROUNDING);
        let last = libm::ceil((middle + 0.5 * dot_m - origin) / raster.cell_m - ROUNDING).max(first + 1.0);
        index(first, count)..index(last, count)
    };
    let (columns, rows) = (span(point.x, raster.origin.x, raster.width), span(point.y, raster.origin.y, raster.height));
    let cells = rows.flat_map(|row| &raster.occupancy[row * raster.width..][columns.clone()]);
    cells.copied().max().unwrap_or(Raster::UNKNOWN)
}

/// Cells that a dot only touches do not count.
const ROUNDING: f64 = 1e-6;

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the raster")]
fn index(number: f64, count: usize) -> usize {
    number.clamp(0.0, count as f64) as usize
}

/// The robot's heading: eight directions, in ASCII four.
fn arrow(pose: Pose2, look: Look) -> &'static str {
    let eighths = libm::round((pose.theta_rad + TAU) / FRAC_PI_4);
    let eighth = index(eighths, 16) % 8;
    let signs = if look.unicode {
        ["→", "↗", "↑", "↖", "←", "↙", "↓", "↘"]
    } else {
        [">", "^", "^", "^", "<", "v", "v", "v"]
    };
    signs[eighth]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::dashboard::Plan;
    use std::sync::Arc;

    fn plan() -> Raster {
        let mut occupancy = vec![Raster::UNKNOWN; 100 * 100];
        for cell in 0..100 {
            occupancy[50 * 100 + cell] = if cell == 30 { 100 } else { 0 };
        }
        Raster { width: 100, height: 100, cell_m: 0.1, origin: Point::new(-5.0, -5.0), occupancy }
    }

    #[test]
    fn a_thin_wall_is_seen_from_afar() {
        let raster = plan();
        assert_eq!(highest(&raster, Point::new(-1.9, 0.1), 1.0), 100);
        assert_eq!(highest(&raster, Point::new(3.0, 0.1), 1.0), 0);
        assert_eq!(highest(&raster, Point::new(3.0, 3.0), 1.0), Raster::UNKNOWN);
        assert_eq!(highest(&raster, Point::new(300.0, 3.0), 1.0), Raster::UNKNOWN);
        assert_eq!(highest(&raster, Point::new(-1.95, 0.05), 0.01), 100, "a dot smaller than a cell");
    }

    #[test]
    fn the_known_part_is_shown_whole_until_it_is_zoomed() {
        let dashboard = Dashboard { plan: Arc::new(Plan::new(plan())), ..Dashboard::default() };
        let area = Rect::new(0, 0, 30, 10);
        let (centre, dot_m) = window(area, &dashboard, View::default());
        assert!(60.0 * dot_m >= 10.0 && 60.0 * dot_m < 10.0 * STEP * STEP, "{dot_m}");
        assert!(centre.x.abs() <= dot_m && (centre.y - 0.05).abs() <= dot_m);
        let (_, nearer) = window(area, &dashboard, View { zoom: 2, ..View::default() });
        assert!((dot_m / nearer - 2.0).abs() < 1e-9);
    }
}
