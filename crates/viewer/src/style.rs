//! Names, colours and sizes of everything shown, and the static data.

use rerun::{RecordingStream, RecordingStreamResult};
use slamd_core::{FaultKind, Ring, SensorState, Verdict};

/// Entity paths. They follow the tree of frames, named as in REP-105.
pub(super) const MAP: &str = "map";
pub(super) const GRID: &str = "map/grid";
pub(super) const WALLS: &str = "map/walls";
pub(super) const WALL_BANDS: &str = "map/walls/two_sigma";
pub(super) const ELLIPSE: &str = "map/covariance";
pub(super) const TRAILS: [&str; 3] = ["map/path/truth", "map/path/odometry", "map/path/estimated"];
pub(super) const ODOM: &str = "map/odom";
pub(super) const BASE_LINK: &str = "map/odom/base_link";
pub(super) const BODY: &str = "map/odom/base_link/body";
pub(super) const CONES: &str = "map/odom/base_link/cones";
pub(super) const ECHOES: &str = "map/odom/base_link/echoes";
pub(super) const SENSORS: &str = "map/odom/base_link/sensors";
pub(super) const HEADING: &str = "series/heading_deg";
pub(super) const NIS: &str = "series/nis";
pub(super) const SCORES: &str = "series/fault_score";
pub(super) const RESIDUALS: &str = "series/pca_residual_m";
pub(super) const RATES: &str = "series/per_second";
pub(super) const DELAYS: &str = "series/delay_ms";
pub(super) const DROPS: &str = "series/dropped";
pub(super) const LOCALIZATION: &str = "state/position";
pub(super) const LOG: &str = "log";

/// A sensor's frame.
#[must_use]
pub(super) fn sonar(sensor: usize) -> String {
    format!("{BASE_LINK}/sonar_{sensor:02}")
}

/// A sensor's lane of states.
#[must_use]
pub(super) fn lane(sensor: usize) -> String {
    format!("state/sonar_{sensor:02}")
}

/// Red, green, blue, opacity.
pub(super) type Rgba = [u8; 4];

/// Rerun's colour of unknown cells, so that the map has no visible edge.
pub(super) const UNKNOWN: Rgba = [112, 137, 134, 255];
pub(super) const DARK: Rgba = [20, 24, 31, 255];
pub(super) const ESTIMATED: Rgba = [30, 110, 255, 255];
pub(super) const ODOMETRY: Rgba = [245, 158, 11, 255];
pub(super) const TRUTH: Rgba = [140, 146, 158, 255];
pub(super) const WALL: Rgba = [13, 148, 136, 255];
pub(super) const ROBOT: Rgba = [30, 110, 255, 255];
pub(super) const FAULTY: Rgba = [235, 50, 50, 255];
const USED: Rgba = [16, 185, 129, 255];
const UNEXPLAINED: Rgba = [245, 158, 11, 255];
const SILENT: Rgba = [120, 130, 145, 255];

/// The colour of a verdict.
#[must_use]
pub(super) const fn verdict(verdict: Verdict) -> Rgba {
    match verdict {
        Verdict::Used => USED,
        Verdict::Unexplained => UNEXPLAINED,
        Verdict::Silent => SILENT,
        Verdict::Ignored => FAULTY,
    }
}

/// The colour of a sensor.
#[must_use]
pub(super) const fn state(state: SensorState) -> Rgba {
    match state {
        SensorState::Healthy => USED,
        SensorState::Faulty(_) => FAULTY,
    }
}

/// The name of a state.
#[must_use]
pub(super) const fn word(state: SensorState) -> &'static str {
    match state {
        SensorState::Healthy => "healthy",
        SensorState::Faulty(kind) => kind.word(),
    }
}

/// Words of [`LOCALIZATION`].
pub(super) const KNOWN: &str = "known";
pub(super) const LOST: &str = "lost";

/// Logs the static data of a stream.
///
/// # Errors
/// As Rerun reports them.
pub(super) fn log(rec: &RecordingStream) -> RecordingStreamResult<()> {
    rec.log_static(MAP, &rerun::ViewCoordinates::RIGHT_HAND_Z_UP())?;
    let names = [
        (HEADING, vec!["estimated", "encoders alone"], vec![ESTIMATED, ODOMETRY]),
        (NIS, vec!["NIS (mean 1 if consistent)"], vec![ESTIMATED]),
        (RATES, vec!["sweeps", "CRC errors", "lost frames", "dropped sweeps"], vec![USED, FAULTY, UNEXPLAINED, TRUTH]),
        (DELAYS, vec!["ping to pose", "computing"], vec![ESTIMATED, USED]),
        (DROPS, vec!["not shown"], vec![FAULTY]),
    ];
    for (path, names, colours) in names {
        let colours: Vec<rerun::Color> = colours.into_iter().map(colour).collect();
        rec.log_static(path, &rerun::SeriesLines::new().with_names(names).with_colors(colours).with_widths([1.5]))?;
    }
    let words = [KNOWN, LOST];
    rec.log_static(LOCALIZATION, &states(words, [USED, FAULTY]))
}

/// Logs the static data of a ring: its frames and the robot's outline.
///
/// # Errors
/// As Rerun reports them.
#[expect(clippy::cast_possible_truncation, reason = "for display")]
pub(super) fn log_ring(rec: &RecordingStream, ring: &Ring) -> RecordingStreamResult<()> {
    for (sensor, mounting) in ring.mountings.iter().enumerate() {
        rec.log_static(sonar(sensor), &super::shapes::transform(mounting.robot_from_sensor))?;
    }
    let names: Vec<String> = (0..ring.len()).map(|sensor| format!("sonar_{sensor:02}")).collect();
    for path in [SCORES, RESIDUALS] {
        rec.log_static(path, &rerun::SeriesLines::new().with_names(names.clone()))?;
    }
    let radius = |m: &slamd_core::Mounting| m.robot_from_sensor.position().coords.norm();
    let radius_m = ring.mountings.iter().map(radius).fold(0.1, f64::max) as f32;
    rec.log_static(BODY, &super::shapes::robot(radius_m, ROBOT))
}

/// Logs the lane of a sensor.
///
/// # Errors
/// As Rerun reports them.
pub(super) fn log_lane(rec: &RecordingStream, sensor: usize) -> RecordingStreamResult<()> {
    let kinds = [FaultKind::Missing, FaultKind::Saturated, FaultKind::Noisy, FaultKind::Stuck];
    let [missing, saturated, noisy, stuck] = kinds.map(FaultKind::word);
    let words = [word(SensorState::Healthy), missing, saturated, noisy, stuck];
    let colours = [USED, [185, 28, 28, 255], FAULTY, [249, 115, 22, 255], [190, 24, 93, 255]];
    rec.log_static(lane(sensor), &states(words, colours))
}

fn states<const N: usize>(words: [&str; N], colours: [Rgba; N]) -> rerun::StateConfiguration {
    rerun::StateConfiguration::new().with_values(words).with_colors(colours.map(colour))
}

/// Converts a colour.
#[must_use]
pub(super) fn colour([r, g, b, a]: Rgba) -> rerun::Color {
    rerun::Color::from_unmultiplied_rgba(r, g, b, a)
}
