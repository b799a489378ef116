//! Writes the frames that a board would have sent.

use super::ImportError;
use slamd_capture::{CaptureError, CaptureInfo, CaptureWriter};
use slamd_core::{Config, Mounting, Ring, Timestamp};
use slamd_files::{Output, PartFile};
use slamd_protocol::{
    Echo, Encoder, FrameEncoder, Geometry, Hello, Message, Placement, SensorEcho, Sonar, Status, Text, VERSION_MAJOR,
    VERSION_MINOR,
};
use std::collections::BTreeSet;
use std::fmt;

/// What an import has written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Rows with ranges.
    pub rows: u64,
    /// Rows with encoders alone.
    pub encoder_rows: u64,
    /// Lines of other kinds, skipped.
    pub skipped: u64,
    /// Stamps that stepped back and were put 1 ms behind their predecessor.
    pub clamped: u64,
    /// Sweeps that were collected from rows of a part of the ring each.
    pub collected: u64,
    /// Missing encoder counts that were interpolated.
    pub filled_ticks: u64,
    /// Rows without anything, or without counts at the beginning or the end, left out.
    pub left_out: u64,
    /// From the first stamp to the last, seconds.
    pub duration_s: f64,
    /// What is doubtful of the recording, one sentence each.
    pub doubts: Vec<String>,
    /// What is wrong with the counts, each with its line.
    pub remarks: Vec<String>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |count: u64, one: &str, many: &str| format!("{count} {}", if count == 1 { one } else { many });
        write!(f, "{} over {:.1} s", plural(self.rows, "row of ranges", "rows of ranges"), self.duration_s)?;
        for (count, one, many) in [
            (self.encoder_rows, "row of encoders alone", "rows of encoders alone"),
            (
                self.collected,
                "sweep collected from them, because each holds a part of the ring",
                "sweeps collected from them, because each holds a part of the ring",
            ),
            (self.filled_ticks, "missing encoder count interpolated", "missing encoder counts interpolated"),
            (
                self.left_out,
                "row without counts or without anything left out",
                "rows without counts or without anything left out",
            ),
            (self.skipped, "line of another kind skipped", "lines of other kinds skipped"),
            (
                self.clamped,
                "stamp that stepped back put 1 ms behind its predecessor",
                "stamps that stepped back put 1 ms behind their predecessor",
            ),
        ] {
            if count > 0 {
                write!(f, "; {}", plural(count, one, many))?;
            }
        }
        Ok(())
    }
}

/// Writes one recording as a capture.
pub(super) struct Recorder {
    writer: CaptureWriter<PartFile>,
    encoder: FrameEncoder,
    groups: Vec<(u8, Vec<u8>)>,
    sound_m_s: f64,
    zero_s: Option<f64>,
    last: Timestamp,
    pub(super) summary: Summary,
}

const STEP_BACK_US: u64 = 1_000;
/// Time between two counts in a pause, seconds.
const BRIDGE_S: f64 = 60.0;

impl Recorder {
    /// Creates the capture and writes HELLO, GEOMETRY and STATUS.
    pub(super) fn create(
        capture: Output,
        config: &Config,
        notes: String,
        unix_zero_us: Option<u64>,
    ) -> Result<Self, ImportError> {
        let ring = config.ring.ring().ok_or(ImportError::Config("ring.circle or ring.sensors"))?;
        let ticks = config.robot.ticks_per_turn.ok_or(ImportError::Config("robot.ticks_per_turn"))?;
        let info = CaptureInfo {
            slamd_version: env!("CARGO_PKG_VERSION").into(),
            protocol_version: format!("{VERSION_MAJOR}.{VERSION_MINOR}"),
            config_toml: config.to_toml(),
            unix_zero_us,
            notes,
            faults: None,
        };
        let temperature_cdeg = hundredths(config.ring.temperature_c);
        let mut recorder = Self {
            writer: CaptureWriter::output(capture, &info)?,
            encoder: FrameEncoder::default(),
            groups: groups(&ring),
            sound_m_s: 331.3 + 0.606 * 1e-2 * f64::from(temperature_cdeg),
            zero_s: None,
            last: Timestamp::default(),
            summary: Summary::default(),
        };
        recorder.write(&hello(&ring, ticks))?;
        let placements: Vec<Placement> = ring.mountings.iter().map(placement).collect();
        let parts = Geometry::of_ring(&placements).map_err(|_| ImportError::Config("a ring of at most 64 sensors"))?;
        for part in parts {
            recorder.write(&Message::Geometry(part))?;
        }
        let status = Status { temperature_cdeg: Some(temperature_cdeg), ..Status::default() };
        recorder.write(&Message::Status(status))?;
        Ok(recorder)
    }

    /// The recording's clock says `t_s`, whatever its zero.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a float's cast stops at the limits")]
    pub(super) fn advance(&mut self, t_s: f64) {
        let zero_s = *self.zero_s.get_or_insert(t_s);
        let since_us = (t_s - zero_s) * 1e6;
        let mut at = Timestamp::from_us(since_us.max(0.0).round() as u64);
        if since_us < 0.0 || at < self.last {
            at = Timestamp::from_us(self.last.us().saturating_add(STEP_BACK_US));
            self.summary.clamped += 1;
        }
        self.last = at;
        self.summary.duration_s = at.seconds();
    }

    /// One row: per sensor the metres, infinity for no echo, none for no measurement.
    pub(super) fn sonar(
        &mut self,
        [left_ticks, right_ticks]: [i32; 2],
        ranges_m: &[Option<f64>],
    ) -> Result<(), CaptureError> {
        self.summary.rows += 1;
        let t_us = self.clock_us();
        for at in 0..self.groups.len() {
            let Some((group, sensors)) = self.groups.get(at) else { break };
            let heard = sensors.iter().filter_map(|&sensor| {
                let range_m = (*ranges_m.get(usize::from(sensor))?)?;
                Some(SensorEcho { sensor, echo: echo(range_m, self.sound_m_s) })
            });
            let sonar = Sonar {
                t_us,
                group: *group,
                last_of_cycle: at + 1 == self.groups.len(),
                left_ticks,
                right_ticks,
                echoes: heard.collect(),
            };
            self.write(&Message::Sonar(sonar))?;
        }
        Ok(())
    }

    /// One row of a part of the ring, with its own time and counts; the last of a cycle ends the sweep. Arguments as in [`Recorder::sonar`].
    pub(super) fn part(
        &mut self,
        [left_ticks, right_ticks]: [i32; 2],
        ranges_m: &[Option<f64>],
        last_of_cycle: bool,
    ) -> Result<(), CaptureError> {
        self.summary.rows += 1;
        self.summary.collected += u64::from(last_of_cycle);
        let heard = (0u8..)
            .zip(ranges_m)
            .filter_map(|(sensor, range_m)| Some(SensorEcho { sensor, echo: echo((*range_m)?, self.sound_m_s) }));
        let echoes = heard.collect();
        // A group of the ring would stand for all its sensors; this number stands for those that are named.
        let group = (0..=u8::MAX).rev().find(|name| self.groups.iter().all(|(group, _)| group != name));
        let (t_us, group) = (self.clock_us(), group.unwrap_or(u8::MAX));
        self.write(&Message::Sonar(Sonar { t_us, group, last_of_cycle, left_ticks, right_ticks, echoes }))
    }

    /// Encoders alone.
    pub(super) fn encoders(&mut self, [left_ticks, right_ticks]: [i32; 2]) -> Result<(), CaptureError> {
        self.summary.encoder_rows += 1;
        let t_us = self.clock_us();
        self.write(&Message::Encoder(Encoder { t_us, left_ticks, right_ticks, flags: 0 }))
    }

    /// Stands still through a pause. A board's clock wraps after 71 minutes, so it must be heard of more often than that.
    pub(super) fn bridge(&mut self, from_s: f64, to_s: f64, ticks: [i32; 2]) -> Result<(), CaptureError> {
        // Counted from the begin: where stamps are huge, adding to a stamp may not change it.
        let mut steps = 1.0;
        while steps * BRIDGE_S < to_s - from_s {
            self.advance(from_s + steps * BRIDGE_S);
            self.encoders(ticks)?;
            self.summary.encoder_rows -= 1;
            steps += 1.0;
        }
        Ok(())
    }

    pub(super) fn finish(self) -> Result<Summary, CaptureError> {
        self.writer.finish()?;
        Ok(self.summary)
    }

    /// The time of the current row in the capture.
    pub(super) const fn at(&self) -> Timestamp {
        self.last
    }

    #[expect(clippy::cast_possible_truncation, reason = "the low 32 bits are meant")]
    fn clock_us(&self) -> u32 {
        self.last.us() as u32
    }

    fn write(&mut self, message: &Message) -> Result<(), CaptureError> {
        let frame = self.encoder.encode(message);
        self.writer.received(self.last, &frame)
    }
}

fn groups(ring: &Ring) -> Vec<(u8, Vec<u8>)> {
    let names: BTreeSet<u8> = ring.mountings.iter().map(|mounting| mounting.group).collect();
    let members = |group| (0u8..).zip(&ring.mountings).filter(move |(_, mounting)| mounting.group == group);
    names.into_iter().map(|group| (group, members(group).map(|(sensor, _)| sensor).collect())).collect()
}

fn hello(ring: &Ring, ticks_per_turn: u32) -> Message {
    Message::Hello(Hello {
        major: VERSION_MAJOR,
        minor: VERSION_MINOR,
        boot_id: 1,
        tick_hz: 1_000_000,
        sensors: u8::try_from(ring.len()).unwrap_or(u8::MAX),
        ticks_per_turn,
        capabilities: 0,
        config_crc: 0,
        uid: *b"imported",
        board: Text::new("imported"),
        firmware: Text::new(env!("CARGO_PKG_VERSION")),
    })
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most 2 m and 60 degrees by configuration"
)]
fn placement(mounting: &Mounting) -> Placement {
    let pose = mounting.robot_from_sensor;
    Placement {
        x_mm: (pose.x_m * 1e3).round() as i16,
        y_mm: (pose.y_m * 1e3).round() as i16,
        bearing_cdeg: hundredths(pose.theta_rad.to_degrees()),
        half_angle_cdeg: (mounting.half_angle_rad.to_degrees() * 1e2).round() as u16,
        group: mounting.group,
    }
}

#[expect(clippy::cast_possible_truncation, reason = "an angle or an air temperature in degrees")]
fn hundredths(degrees: f64) -> i16 {
    (degrees * 1e2).round() as i16
}

/// Time of flight there and back.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a float's cast stops at the limits")]
fn echo(range_m: f64, sound_m_s: f64) -> Echo {
    Echo::from_flight_us((range_m * 2e6 / sound_m_s).round() as u32)
}
