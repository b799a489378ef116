//! What the terminal view shows of a session, cell by cell, without a terminal.

#![allow(clippy::unwrap_used, reason = "a test may")]

use nalgebra::Matrix3;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::Color;
use slamd::monitor::{Dashboard, Line, Look, Plan, Rates, Tone, View, draw};
use slamd_core::{
    Calibration, Counters, EncoderState, Estimate, FaultEvent, FaultKind, ModelAspect, ModelEvent, ModelFinding,
    ModelState, Point, Pose2, Raster, Ring, SensorState, Snapshot, Timestamp,
};
use std::sync::Arc;

const FULL: Look = Look { unicode: true, colour: true };
const PLAIN: Look = Look { unicode: false, colour: false };
const SMALL: (u16, u16) = (80, 24);
const LARGE: (u16, u16) = (120, 40);

/// A room of 6 x 4 m, the robot in its middle, 16 sensors of which 3 is faulty and 9 silent.
fn dashboard() -> Dashboard {
    let (width, height) = (64, 44);
    let mut occupancy = vec![Raster::UNKNOWN; width * height];
    for row in 1..43 {
        for column in 1..63 {
            let is_wall = row == 1 || row == 42 || column == 1 || column == 62;
            occupancy[row * width + column] = if is_wall { 100 } else { 0 };
        }
    }
    let raster = Raster { width, height, cell_m: 0.1, origin: Point::new(-3.2, -2.2), occupancy };
    let ring = Ring::circle(16, 0.12, 0.2, 4);
    let range_m = |sensor| match sensor {
        9 => f64::NAN,
        5 => f64::INFINITY,
        _ => 2.0,
    };
    let stuck = SensorState::Faulty(FaultKind::Stuck);
    let mut states = vec![SensorState::Healthy; ring.len()];
    states[3] = stuck;
    let change = FaultEvent {
        at: Timestamp::from_us(5_000_000),
        sensor: 3,
        state: stuck,
        reason: "sensor 3 always reads 2.00 m".into(),
    };
    let session = Snapshot {
        robot: "r2".into(),
        at: Timestamp::from_us(3_723_000_000),
        counters: Counters { sweeps: 1234, frames: 9876, crc_errors: 17, ..Counters::default() },
        ranges_m: (0..ring.len()).map(range_m).collect(),
        ring,
        states,
        changes: vec![None, None, None, Some(change)],
        estimate: Some(Estimate {
            at: Timestamp::default(),
            sweep: 1234,
            pose: Pose2::new(1.25, -0.5, 90f64.to_radians()),
            covariance: Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0004, 0.0009, 0.0003)),
            odometry: Pose2::default(),
            nis: 1.0,
        }),
        calibration: Some(Calibration {
            wheel_ratio: 1.0102,
            wheel_ratio_sigma: 0.0004,
            wheel_base_m: 0.2345,
            wheel_base_sigma_m: 0.0012,
        }),
        ..Snapshot::default()
    };
    Dashboard {
        session,
        line: Line { word: "streaming", cause: "/dev/ttyUSB0 at 115200 baud".into(), tone: Tone::Good },
        rates: Rates { sweeps: 9.9, frames: 91.2, crc_errors: 0.5, ..Rates::default() },
        max_range_m: 4.0,
        plan: Arc::new(Plan::new(raster)),
        ..Dashboard::default()
    }
}

fn screen(size: (u16, u16), dashboard: &Dashboard, view: View, look: Look) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    let log = ["0.1  INFO ring of 16 sensors".into(), "5.0  WARN the newest line".into()];
    terminal.draw(|frame| draw(frame.area(), frame.buffer_mut(), dashboard, &log, view, look)).unwrap();
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let rows = buffer.content().chunks(usize::from(buffer.area.width));
    rows.map(|cells| cells.iter().map(|cell| cell.symbol()).collect::<String>() + "\n").collect()
}

/// The places of a symbol in the pane below a title.
fn places(buffer: &Buffer, symbol: &str) -> Vec<(u16, u16)> {
    let area = buffer.area;
    area.positions().filter(|place| buffer[*place].symbol() == symbol).map(|place| (place.x, place.y)).collect()
}

#[test]
fn everything_is_shown_at_both_sizes() {
    for size in [SMALL, LARGE] {
        let shown = text(&screen(size, &dashboard(), View::default(), FULL));
        for words in [
            "slamd monitor  r2  1:02:03",
            "streaming",
            "/dev/ttyUSB0 at 115200 baud",
            "sweeps     9.9/s     1234",
            "frames    91.2/s     9876",
            "CRC err    0.5/s       17",
            "1.250 ± 0.020 m",
            "-0.500 ± 0.030 m",
            "90.0 ± 1.0°",
            "1.0102 ± 0.0004",
            "0.2345 ± 0.0012 m",
            "ok 14 bad 1 silent 1",
            "faulty sensors: 1",
            "3 always reads 2.00 m",
            "WARN the newest line",
            "q quit",
        ] {
            assert!(shown.contains(words), "{size:?}: no \"{words}\" in\n{shown}");
        }
    }
}

#[test]
fn a_difference_from_the_configuration_comes_first() {
    let (at, mut dashboard) = (Timestamp::default(), dashboard());
    let clause = "the wheels turn the other way".into();
    let finding =
        ModelFinding { aspect: ModelAspect::TurnSign, measured: -1.0, sigma: 0.0, clause, remedies: Vec::new() };
    dashboard.session.models = vec![ModelEvent { at, since: at, finding, state: ModelState::Doubted }];
    let shown = text(&screen(LARGE, &dashboard, View::default(), FULL));
    let place = |words: &str| shown.find(words).unwrap_or_else(|| panic!("no \"{words}\" in\n{shown}"));
    assert!(shown.contains("doubts: 1, faulty sensors: 1"), "{shown}");
    assert!(place("the wheels turn the other way") < place("3 always reads"), "{shown}");
}

#[test]
fn rays_have_the_colour_of_their_sensor() {
    let buffer = screen(LARGE, &dashboard(), View::default(), FULL);
    let rays = |colour| {
        let is_ray = |symbol: &str| symbol.chars().all(|c| ('\u{2801}'..='\u{28ff}').contains(&c));
        buffer.content().iter().filter(|cell| is_ray(cell.symbol()) && cell.fg == colour).count()
    };
    let (healthy, faulty, silent) = (rays(Color::Green), rays(Color::Red), rays(Color::Yellow));
    assert!(healthy > 30 && faulty >= 4 && silent >= 1, "{healthy} {faulty} {silent}\n{}", text(&buffer));
    assert!(healthy > 5 * faulty && faulty > silent, "{healthy} {faulty} {silent}");
}

#[test]
fn a_longer_range_is_a_longer_ray() {
    let marks = |range_m: f64| {
        let mut dashboard = dashboard();
        dashboard.session.ranges_m.fill(range_m);
        places(&screen(LARGE, &dashboard, View::default(), PLAIN), "*").len()
    };
    assert!(marks(3.0) > marks(1.5) && marks(1.5) > marks(0.3), "{} {} {}", marks(3.0), marks(1.5), marks(0.3));
}

#[test]
fn the_map_has_its_walls_about_the_robot() {
    for (look, arrow) in [(FULL, "↑"), (PLAIN, "^")] {
        let buffer = screen(SMALL, &dashboard(), View::default(), look);
        // The ring has an arrow of its own; the map is at the right.
        let robot = *places(&buffer, arrow).iter().max().unwrap();
        let is_wall = |x: u16, y: u16| {
            let symbol = buffer[(x, y)].symbol();
            symbol == "#" || symbol.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c))
        };
        let walls = [
            (52..robot.0).any(|x| is_wall(x, robot.1)),
            (robot.0 + 1..80).any(|x| is_wall(x, robot.1)),
            (3..robot.1).any(|y| is_wall(robot.0, y)),
            (robot.1 + 1..16).any(|y| is_wall(robot.0, y)),
        ];
        assert_eq!(walls, [true; 4], "left, right, above, below of {robot:?}\n{}", text(&buffer));
        // x = 1.25 of −3..3, y = −0.5: right of the middle, and below it.
        assert!(robot.0 > 67 && robot.1 > 9, "{robot:?}\n{}", text(&buffer));
    }
}

#[test]
fn the_map_can_be_zoomed_and_follows_the_robot() {
    let view = |keys: &str| {
        let mut view = View::default();
        keys.chars().for_each(|key| assert!(view.key(key)));
        text(&screen(SMALL, &dashboard(), view, PLAIN))
    };
    let walls = |shown: &str| shown.matches('#').count();
    assert!(walls(&view("++++")) < walls(&view("")), "walls are out of sight\n{}", view("++++"));
    let followed = view("c");
    let row = followed.lines().position(|line| line.get(52..).is_some_and(|map| map.contains('^'))).unwrap();
    assert!((8..=10).contains(&row), "in the map's middle row\n{followed}");
    assert!(view("p").contains("paused") && view("?").contains("Ctrl-C"));
}

#[test]
fn without_unicode_there_is_only_ascii() {
    let mut dashboard = dashboard();
    dashboard.session.robot = "Käfer".into();
    let shown = text(&screen(SMALL, &dashboard, View::default(), PLAIN));
    assert!(shown.is_ascii(), "{shown}");
    assert!(shown.contains("K?fer") && shown.contains("1.250 +- 0.020 m"), "{shown}");
}

#[test]
fn a_broken_encoder_is_shown_beside_the_wheels() {
    let shown = text(&screen(SMALL, &dashboard(), View::default(), FULL));
    assert!(shown.contains("wheels, right to left") && !shown.contains("encoder"), "{shown}");
    let mut dashboard = dashboard();
    dashboard.session.encoders = [EncoderState::Healthy, EncoderState::Reversed];
    let shown = text(&screen(SMALL, &dashboard, View::default(), FULL));
    assert!(shown.contains("right encoder reversed"), "{shown}");
}

#[test]
fn without_colour_states_still_differ() {
    let buffer = screen(SMALL, &dashboard(), View::default(), Look { unicode: true, colour: false });
    assert!(buffer.content().iter().all(|cell| cell.fg == Color::Reset && cell.bg == Color::Reset));
    let ring: String = text(&buffer).lines().take(16).map(|line| line.chars().take(24).collect::<String>()).collect();
    assert!(ring.contains('3') && ring.contains('?'), "{}", text(&buffer));
}

#[test]
fn a_small_terminal_shows_the_size_that_is_needed() {
    let shown = text(&screen((60, 20), &dashboard(), View::default(), FULL));
    assert!(shown.contains("60 columns and 20 rows") && shown.contains("80 and 24"), "{shown}");
}

#[test]
fn the_map_has_the_path_and_a_scale() {
    let mut dashboard = dashboard();
    for x in -20..10 {
        dashboard.track.push(Point::new(0.1 * f64::from(x), -1.0));
    }
    let shown = text(&screen(SMALL, &dashboard, View::default(), PLAIN));
    assert!(shown.lines().any(|line| line.matches('+').count() > 8 && line.contains("+++++")), "{shown}");
    // The room is 6 m wide: a bar of 2 m is a third of it.
    let bar =
        shown.lines().find_map(|line| line.split_once("| 2 m ")).unwrap_or_else(|| panic!("no bar in\n{shown}")).0;
    let bar_columns = 1 + bar.len() - bar.rfind('|').unwrap();
    let wall = shown.lines().map(|line| line.matches('#').count()).max().unwrap();
    assert!((bar_columns * 3).abs_diff(wall) <= 4, "{bar_columns} for {wall}\n{shown}");
}

#[test]
fn nothing_is_known_at_first() {
    let shown = text(&screen(SMALL, &Dashboard::default(), View::default(), FULL));
    assert!(shown.contains("no ring is known yet") && shown.contains("not known yet"), "{shown}");
    assert!(shown.contains("no map yet: no frame has"), "{shown}");
}
