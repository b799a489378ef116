//! The lines that clients receive. JSON has no NaN and no infinity: NaN becomes null, and a range without a number becomes a word.
//! `docs/api.md` describes each field; a test compares it with this file.

use super::request::Watch;
use crate::drive::Granted;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;
use serde::Serialize;
use slamd_core::{
    Counters, FaultEvent, ModelAspect, ModelEvent, Mounting, Raster, SensorState, Snapshot, Timestamp, Verdict,
    link::LinkState,
};
use slamd_publish::grey_png;

/// What a `DEVICE` report depends on: link state and cause, the board's protocol, the number of sensors. A change is reported.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct DeviceState {
    link: LinkState,
    cause: String,
    protocol: Option<(u8, u8)>,
    sensors: usize,
}

impl DeviceState {
    pub(super) fn is_state_of(&self, snapshot: &Snapshot) -> bool {
        (self.link, &self.cause, self.protocol, self.sensors)
            == (snapshot.link, &snapshot.cause, snapshot.protocol, snapshot.ring.len())
    }

    pub(super) fn new(snapshot: &Snapshot) -> Self {
        let (cause, sensors) = (snapshot.cause.clone(), snapshot.ring.len());
        Self { link: snapshot.link, cause, protocol: snapshot.protocol, sensors }
    }
}

/// Version of the lines: a new major version changes fields, a new minor version adds fields.
pub const MAJOR: u32 = 1;
/// See [`MAJOR`].
pub const MINOR: u32 = 1;

/// A line for a client. Each field's unit is in its name; `docs/api.md` describes them.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "class", rename_all = "UPPERCASE")]
#[expect(missing_docs, reason = "docs/api.md describes each field, and a test compares")]
pub enum Report<'a> {
    Version { release: &'static str, api_major: u32, api_minor: u32 },
    Watch(Watch),
    Device(Device<'a>),
    Pose(Pose),
    Sweep(Sweep),
    Map(Map),
    Fault(Fault<'a>),
    Model(Model<'a>),
    Stats(Stats),
    Drive(Drive),
    Error { message: &'a str },
}

/// The link, the robot and its board.
#[derive(Clone, Debug, Serialize)]
pub struct Device<'a> {
    pub time_s: f64,
    pub began_unix_s: Option<f64>,
    pub robot: &'a str,
    pub link: &'static str,
    pub cause: &'a str,
    pub board: Option<&'a str>,
    pub firmware: Option<&'a str>,
    pub protocol: Option<String>,
    pub sensors: Vec<Sensor>,
}

/// What slamd commands to the motors.
#[derive(Clone, Debug, Serialize)]
pub struct Drive {
    pub forward_m_s: f64,
    pub turn_rad_s: f64,
    pub for_ms: u16,
    pub motors: Option<&'static str>,
}

/// Where a sensor is mounted.
#[derive(Clone, Debug, Serialize)]
pub struct Sensor {
    pub x_m: f64,
    pub y_m: f64,
    pub bearing_rad: f64,
    pub half_angle_rad: f64,
}

/// The robot's pose.
#[derive(Clone, Debug, Serialize)]
pub struct Pose {
    pub time_s: f64,
    pub sweep: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub theta_rad: f64,
    pub covariance_m_rad: [[f64; 3]; 3],
    pub odom_x_m: f64,
    pub odom_y_m: f64,
    pub odom_theta_rad: f64,
    pub nis: f64,
    pub is_lost: bool,
}

/// One sweep of the ring.
#[derive(Clone, Debug, Serialize)]
pub struct Sweep {
    pub time_s: f64,
    pub sweep: u64,
    pub ranges_m: Vec<Range>,
    pub verdicts: Vec<&'static str>,
}

/// A range in metres, or a word if it is no number; no measurement is null.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Range {
    Metres(f64),
    Word(&'static str),
    None,
}

/// The map as a PNG image.
#[derive(Clone, Debug, Serialize)]
pub struct Map {
    pub time_s: f64,
    pub width: usize,
    pub height: usize,
    pub cell_m: f64,
    pub origin_x_m: f64,
    pub origin_y_m: f64,
    pub png_base64: String,
}

/// A change of a sensor's state.
#[derive(Clone, Debug, Serialize)]
pub struct Fault<'a> {
    pub time_s: f64,
    pub sensor: usize,
    pub state: &'static str,
    pub reason: &'a str,
}

/// A change of what is known of the robot's differences from its configuration.
#[derive(Clone, Debug, Serialize)]
pub struct Model<'a> {
    pub time_s: f64,
    pub since_s: f64,
    pub name: &'static str,
    pub sensor: Option<usize>,
    pub measured: f64,
    pub sigma: f64,
    pub state: &'static str,
    pub remedies: Vec<Remedy<'a>>,
    pub text: String,
}

/// A configuration key that mends it, and its value as in TOML.
#[derive(Clone, Debug, Serialize)]
pub struct Remedy<'a> {
    pub key: &'static str,
    pub value: &'a str,
}

/// Counters.
#[derive(Clone, Debug, Serialize)]
pub struct Stats {
    pub time_s: f64,
    pub clients: usize,
    pub frames: u64,
    pub lost_frames: u64,
    pub crc_errors: u64,
    pub malformed: u64,
    pub dropped_bytes: u64,
    pub unknown: u64,
    pub refused: u64,
    pub echoed: u64,
    pub groups: u64,
    pub restarts: u64,
    pub sweeps: u64,
    pub dropped_sweeps: u64,
    /// Wheel steps across a wrap at 16 bits, which are used.
    pub unwrapped_steps: u64,
    /// Wheel steps that no wheel can roll, which are not used.
    pub refused_steps: u64,
    /// Messages not used because the board's clock ran backwards.
    pub refused_stamps: u64,
    /// Damaged frames that hold readable text.
    pub stray_texts: u64,
    pub faulty_sensors: usize,
}

impl<'a> Report<'a> {
    /// The program's and the API's version.
    #[must_use]
    pub const fn version() -> Self {
        Self::Version { release: env!("CARGO_PKG_VERSION"), api_major: MAJOR, api_minor: MINOR }
    }

    /// The link's present state.
    #[must_use]
    pub fn device(snapshot: &'a Snapshot) -> Self {
        let [board, firmware] = &snapshot.board;
        Self::Device(Device {
            time_s: rounded(snapshot.at.seconds()),
            began_unix_s: snapshot.unix_zero_us.map(|us| rounded(Timestamp::from_us(us).seconds())),
            robot: &snapshot.robot,
            link: snapshot.link.word(),
            cause: &snapshot.cause,
            board: snapshot.protocol.map(|_| board.as_str()),
            firmware: snapshot.protocol.map(|_| firmware.as_str()),
            protocol: snapshot.protocol.map(|(major, minor)| format!("{major}.{minor}")),
            sensors: snapshot.ring.mountings.iter().map(Sensor::new).collect(),
        })
    }

    /// The newest pose; none before the first.
    #[must_use]
    pub fn pose(snapshot: &Snapshot) -> Option<Self> {
        let estimate = snapshot.estimate.as_ref()?;
        let (pose, odometry) = (estimate.pose, estimate.odometry);
        let row = |row: usize| [0, 1, 2].map(|column| estimate.covariance[(row, column)]);
        Some(Self::Pose(Pose {
            time_s: rounded(estimate.at.seconds()),
            sweep: estimate.sweep,
            x_m: rounded(pose.x_m),
            y_m: rounded(pose.y_m),
            theta_rad: rounded(pose.theta_rad),
            covariance_m_rad: [0, 1, 2].map(row),
            odom_x_m: rounded(odometry.x_m),
            odom_y_m: rounded(odometry.y_m),
            odom_theta_rad: rounded(odometry.theta_rad),
            nis: rounded(estimate.nis),
            is_lost: snapshot.is_lost,
        }))
    }

    /// The newest sweep; none before the first.
    #[must_use]
    pub fn sweep(snapshot: &Snapshot) -> Option<Self> {
        Some(Self::Sweep(Sweep {
            time_s: rounded(snapshot.sweep_at.seconds()),
            sweep: snapshot.sweep?,
            ranges_m: snapshot.ranges_m.iter().map(|&range_m| Range::new(range_m)).collect(),
            verdicts: snapshot.verdicts.iter().map(|&verdict| word(verdict)).collect(),
        }))
    }

    /// A sensor's state.
    #[must_use]
    pub fn fault(change: &'a FaultEvent) -> Self {
        let state = match change.state {
            SensorState::Healthy => "healthy",
            SensorState::Faulty(kind) => kind.word(),
        };
        let time_s = rounded(change.at.seconds());
        Self::Fault(Fault { time_s, sensor: change.sensor, state, reason: &change.reason })
    }

    /// A difference from the configuration.
    #[must_use]
    pub fn model(event: &'a ModelEvent) -> Self {
        let finding = &event.finding;
        Self::Model(Model {
            time_s: rounded(event.at.seconds()),
            since_s: rounded(event.since.seconds()),
            name: finding.aspect.word(),
            sensor: if let ModelAspect::SensorBearing(sensor) = finding.aspect { Some(sensor) } else { None },
            measured: rounded(finding.measured),
            sigma: rounded(finding.sigma),
            state: event.state.word(),
            remedies: finding.remedies.iter().map(|(key, value)| Remedy { key, value }).collect(),
            text: event.sentence(),
        })
    }

    /// What was commanded.
    #[must_use]
    pub fn drive(granted: &Granted) -> Self {
        let Granted { twist, for_ms, motors } = *granted;
        let (forward_m_s, turn_rad_s) = (rounded(twist.forward_m_s), rounded(twist.turn_rad_s));
        Self::Drive(Drive { forward_m_s, turn_rad_s, for_ms, motors })
    }

    /// The counters; `clients` are connected.
    #[must_use]
    pub fn stats(snapshot: &Snapshot, clients: usize) -> Self {
        let Counters { frames, crc_errors, malformed, dropped_bytes, lost_frames, unknown, .. } = snapshot.counters;
        let Counters { refused, echoed, groups, restarts, sweeps, dropped_sweeps, .. } = snapshot.counters;
        let Counters { unwrapped_steps, refused_steps, refused_stamps, stray_texts, .. } = snapshot.counters;
        Self::Stats(Stats {
            time_s: rounded(snapshot.at.seconds()),
            clients,
            frames,
            lost_frames,
            crc_errors,
            malformed,
            dropped_bytes,
            unknown,
            refused,
            echoed,
            groups,
            restarts,
            sweeps,
            dropped_sweeps,
            unwrapped_steps,
            refused_steps,
            refused_stamps,
            stray_texts,
            faulty_sensors: snapshot.faulty().count(),
        })
    }

    /// The report as one JSON line, with its line feed.
    ///
    /// # Panics
    /// Never: numbers, texts and lists have a JSON form.
    #[must_use]
    pub fn line(&self) -> Bytes {
        let mut line = serde_json::to_vec(self).expect("numbers, texts and lists");
        line.push(b'\n');
        line.into()
    }
}

impl Sensor {
    fn new(mounting: &Mounting) -> Self {
        let pose = mounting.robot_from_sensor;
        Self {
            x_m: rounded(pose.x_m),
            y_m: rounded(pose.y_m),
            bearing_rad: rounded(pose.theta_rad),
            half_angle_rad: rounded(mounting.half_angle_rad),
        }
    }
}

impl Range {
    fn new(range_m: f64) -> Self {
        match range_m {
            _ if range_m.is_finite() => Self::Metres(rounded(range_m)),
            f64::INFINITY => Self::Word("clear"),
            f64::NEG_INFINITY => Self::Word("near"),
            _ => Self::None,
        }
    }
}

/// The map as a line; none while the map is empty.
///
/// # Errors
/// When the PNG cannot be encoded.
pub fn map_line(at: Timestamp, raster: &Raster) -> Result<Option<Bytes>, png::EncodingError> {
    if raster.occupancy.is_empty() {
        return Ok(None);
    }
    let map = Map {
        time_s: rounded(at.seconds()),
        width: raster.width,
        height: raster.height,
        cell_m: raster.cell_m,
        origin_x_m: rounded(raster.origin.x),
        origin_y_m: rounded(raster.origin.y),
        png_base64: STANDARD.encode(grey_png(raster)?),
    };
    Ok(Some(Report::Map(map).line()))
}

const fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Used => "used",
        Verdict::Unexplained => "unexplained",
        Verdict::Silent => "silent",
        Verdict::Ignored => "ignored",
    }
}

/// Rounds to a millionth: further digits carry no information.
fn rounded(value: f64) -> f64 {
    libm::round(value * 1e6) / 1e6
}
