//! Contents of a capture: frames, losses, gaps, and statistics of each sensor and wheel.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use serde::Serialize;
use slamd_capture::{CaptureError, CaptureReader, Record};
use slamd_core::{Board, Timestamp};
use slamd_protocol::{Echo, FrameDecoder, Message, Sonar, kind};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// Shortest listed silence of the link, seconds.
pub const GAP_S: f64 = 0.5;
/// Gaps in the text form; the JSON form has all of them.
const GAPS_SHOWN: usize = 10;
/// Kept reasons of refusals.
const MAX_REFUSALS: usize = 10;

/// Contents of a capture.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// The version of slamd that wrote it.
    pub slamd_version: String,
    /// The capture's notes.
    pub notes: String,
    /// The faults that it declares, as `SENSOR:KIND@TIME`; none if unknown.
    pub faults: Option<Vec<String>>,
    /// The board's description.
    pub board: String,
    /// From the first record to the last, seconds.
    pub duration_s: f64,
    /// Bytes from the board.
    pub received_bytes: u64,
    /// Bytes to the board.
    pub sent_bytes: u64,
    /// Records of the true pose.
    pub truths: u64,
    /// Good frames from the board by type.
    pub frames: BTreeMap<String, Frames>,
    /// Frames whose checksum did not hold.
    pub crc_errors: u64,
    /// Other frames that could not be decoded.
    pub malformed: u64,
    /// Good frames whose content was refused.
    pub refused: u64,
    /// Why, each reason once.
    pub refusals: Vec<String>,
    /// Good frames that the sequence numbers say are missing.
    pub lost_frames: u64,
    /// Silences of the link longer than [`GAP_S`].
    pub gaps: Vec<Gap>,
    /// Each sensor, by id.
    pub sensors: Vec<Sensor>,
    /// The left and the right wheel.
    pub encoders: [Wheel; 2],
    /// The file's damage; none if it is whole.
    pub damage: Option<String>,
}

/// The frames of one type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Frames {
    /// Number of frames.
    pub count: u64,
    /// Frames per second.
    pub rate_hz: f64,
}

/// A silence of the link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Time of the last bytes before it, seconds.
    pub at_s: f64,
    /// Length, seconds.
    pub length_s: f64,
}

/// Statistics of one sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Sensor {
    /// Times that its group fired.
    pub pings: u64,
    /// Times of flight among them.
    pub readings: u64,
    /// "Nothing in range" per cent of the pings.
    pub no_echo_percent: f64,
    /// Pings without a result, per cent.
    pub absent_percent: f64,
    /// Echo pin stuck, high at the trigger, disabled or blanked, per cent of the pings.
    pub failed_percent: f64,
    /// Most equal times of flight in a row.
    pub longest_repeat: u64,
}

/// Motion of one wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Wheel {
    /// From the first count to the last, ticks.
    pub net_ticks: i64,
    /// Forward and backward added, ticks.
    pub path_ticks: u64,
}

/// Reads a capture to its end.
///
/// # Errors
/// When the file cannot be read at all. A file that is truncated or damaged after its header gives a report with [`Report::damage`].
pub fn inspect(path: &Path) -> Result<Report, CaptureError> {
    let mut reader = CaptureReader::open(path)?;
    let info = reader.info();
    let mut reading = Reading::default();
    reading.report.slamd_version.clone_from(&info.slamd_version);
    reading.report.notes.clone_from(&info.notes);
    reading.report.faults.clone_from(&info.faults);
    for record in reader.by_ref() {
        reading.record(&record?);
    }
    reading.report.damage = reader.damage().map(Into::into);
    Ok(reading.finish())
}

#[derive(Default)]
struct Reading {
    report: Report,
    decoder: FrameDecoder,
    board: Board,
    span: Option<(Timestamp, Timestamp)>,
    active_at: Option<Timestamp>,
    seq: Option<u8>,
    fired: BTreeMap<u8, u64>,
    sensors: BTreeMap<u8, Tally>,
    ticks: Option<[i32; 2]>,
}

/// Counts of one sensor.
#[derive(Default)]
struct Tally {
    group: u8,
    answers: u64,
    readings: u64,
    no_echoes: u64,
    last_us: Option<u16>,
    repeat: u64,
    longest_repeat: u64,
}

impl Reading {
    fn record(&mut self, record: &Record) {
        let at = record.at();
        self.span = Some((self.span.map_or(at, |(first, _)| first), at));
        match record {
            Record::Sent { bytes, .. } => self.report.sent_bytes += bytes.len() as u64,
            Record::Truth { .. } => self.report.truths += 1,
            Record::Opened { .. } => self.active(at),
            Record::Received { bytes, .. } => {
                self.report.received_bytes += bytes.len() as u64;
                self.active(at);
                for &byte in bytes {
                    self.byte(byte);
                }
            }
        }
    }

    /// The link was active at this time.
    fn active(&mut self, at: Timestamp) {
        let before = self.active_at.replace(at).unwrap_or(at);
        let length_s = at.seconds_since(before);
        if length_s > GAP_S {
            self.report.gaps.push(Gap { at_s: before.seconds(), length_s });
        }
    }

    fn byte(&mut self, byte: u8) {
        let Some(frame) = self.decoder.push(byte) else { return };
        let name = kind::name(frame.kind).map_or_else(|| format!("{:#04x}", frame.kind), Into::into);
        self.report.frames.entry(name).or_default().count += 1;
        match frame.seq.wrapping_sub(self.seq.unwrap_or_else(|| frame.seq.wrapping_sub(1))) {
            ahead @ 1..128 => {
                self.report.lost_frames += u64::from(ahead - 1);
                self.seq = Some(frame.seq);
            }
            // A late frame that was counted as lost.
            _ => self.report.lost_frames = self.report.lost_frames.saturating_sub(1),
        }
        match Message::parse(frame.kind, frame.payload) {
            Ok(Message::Hello(hello)) => {
                self.reason(Board::check(&hello).err());
                if self.board.greet(hello) {
                    // A restarted board also restarts its sequence numbers and ticks.
                    (self.seq, self.ticks) = (None, None);
                }
            }
            Ok(Message::Geometry(geometry)) => {
                let placed = self.board.place(&geometry);
                self.reason(placed.as_ref().err().cloned());
                let ring = placed.ok().flatten().unwrap_or_default();
                for (sensor, mounting) in (0u8..=u8::MAX).zip(&ring.mountings) {
                    self.sensors.entry(sensor).or_default().group = mounting.group;
                }
            }
            Ok(Message::Sonar(sonar)) => self.sonar(&sonar),
            Ok(Message::Encoder(encoder)) => self.wheels([encoder.left_ticks, encoder.right_ticks]),
            Ok(_) => {}
            Err(error) => {
                self.report.refused += 1;
                self.reason(Some(error.to_string()));
            }
        }
    }

    /// Keeps the reason why a message is not used.
    fn reason(&mut self, reason: Option<String>) {
        let refusals = &mut self.report.refusals;
        if let Some(reason) = reason
            && refusals.len() < MAX_REFUSALS
            && !refusals.contains(&reason)
        {
            refusals.push(reason);
        }
    }

    fn sonar(&mut self, sonar: &Sonar) {
        self.wheels([sonar.left_ticks, sonar.right_ticks]);
        *self.fired.entry(sonar.group).or_default() += 1;
        let total = self.board.hello().map_or(usize::MAX, |hello| usize::from(hello.sensors));
        for result in &sonar.echoes {
            if usize::from(result.sensor) >= total {
                self.reason(Some(format!("SONAR names sensor {}, but the ring has {total}", result.sensor)));
                continue;
            }
            let tally = self.sensors.entry(result.sensor).or_default();
            tally.group = sonar.group;
            tally.add(result.echo);
        }
    }

    fn wheels(&mut self, ticks: [i32; 2]) {
        let before = self.ticks.replace(ticks).unwrap_or(ticks);
        for ((wheel, now), before) in self.report.encoders.iter_mut().zip(ticks).zip(before) {
            let step = now.wrapping_sub(before);
            wheel.net_ticks = wheel.net_ticks.saturating_add(i64::from(step));
            wheel.path_ticks = wheel.path_ticks.saturating_add(u64::from(step.unsigned_abs()));
        }
    }

    fn finish(mut self) -> Report {
        let duration_s = self.span.map_or(0.0, |(first, last)| last.seconds_since(first));
        for frames in self.report.frames.values_mut() {
            frames.rate_hz = if duration_s > 0.0 { frames.count as f64 / duration_s } else { 0.0 };
        }
        let decoded = self.decoder.counters();
        let count = self.sensors.keys().next_back().map_or(0, |&last| usize::from(last) + 1);
        let mut sensors = vec![Sensor::default(); count];
        for (id, tally) in &self.sensors {
            if let Some(sensor) = sensors.get_mut(usize::from(*id)) {
                *sensor = tally.sensor(self.fired.get(&tally.group).copied().unwrap_or(0));
            }
        }
        Report {
            board: self.board.description(),
            duration_s,
            crc_errors: decoded.crc_errors,
            malformed: decoded.malformed,
            sensors,
            ..self.report
        }
    }
}

impl Tally {
    fn add(&mut self, echo: Echo) {
        self.answers += 1;
        let flight = match echo {
            Echo::Flight { us } => Some(us),
            _ => None,
        };
        self.readings += u64::from(flight.is_some());
        self.no_echoes += u64::from(echo == Echo::NoEcho);
        self.repeat = if flight.is_none() {
            0
        } else if flight == self.last_us {
            self.repeat + 1
        } else {
            1
        };
        self.longest_repeat = self.longest_repeat.max(self.repeat);
        self.last_us = flight;
    }

    fn sensor(&self, fired: u64) -> Sensor {
        let pings = fired.max(self.answers);
        let percent = |count: u64| if pings == 0 { 0.0 } else { 100.0 * count as f64 / pings as f64 };
        Sensor {
            pings,
            readings: self.readings,
            no_echo_percent: percent(self.no_echoes),
            absent_percent: percent(pings - self.answers),
            failed_percent: percent(self.answers.saturating_sub(self.readings + self.no_echoes)),
            longest_repeat: self.longest_repeat,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "board      {}", self.board)?;
        writeln!(f, "written by slamd {}", self.slamd_version)?;
        if !self.notes.is_empty() {
            writeln!(f, "notes      {}", self.notes)?;
        }
        if let Some(faults) = &self.faults {
            writeln!(f, "faults     {}", if faults.is_empty() { "none".into() } else { faults.join(", ") })?;
        }
        writeln!(f, "duration   {:.3} s", self.duration_s)?;
        let (received, sent, truths) = (self.received_bytes, self.sent_bytes, self.truths);
        writeln!(f, "bytes      {received} received, {sent} sent; {truths} true poses")?;
        for (name, frames) in &self.frames {
            writeln!(f, "frames     {name:<14} {:>8}  {:>7.2} /s", frames.count, frames.rate_hz)?;
        }
        let Self { crc_errors, malformed, refused, lost_frames, .. } = self;
        writeln!(f, "errors     {crc_errors} checksum, {malformed} malformed, {refused} refused, {lost_frames} lost")?;
        for reason in &self.refusals {
            writeln!(f, "refused    {reason}")?;
        }
        for gap in self.gaps.iter().take(GAPS_SHOWN) {
            writeln!(f, "gap        {:.3} s of silence at {:.3} s", gap.length_s, gap.at_s)?;
        }
        if let Some(more @ 1..) = self.gaps.len().checked_sub(GAPS_SHOWN) {
            let longest_s = self.gaps.iter().map(|gap| gap.length_s).fold(0.0, f64::max);
            writeln!(f, "gap        {more} more; the longest of all {longest_s:.3} s")?;
        }
        for (name, wheel) in ["left", "right"].iter().zip(&self.encoders) {
            writeln!(
                f,
                "wheel      {name:<5} {:>10} ticks net, {:>10} there and back",
                wheel.net_ticks, wheel.path_ticks
            )?;
        }
        writeln!(f, "sensor     pings readings no echo  absent  failed  longest repeat")?;
        for (id, sensor) in self.sensors.iter().enumerate() {
            write!(f, "{id:>6} {:>9} {:>8} ", sensor.pings, sensor.readings)?;
            let (no_echo, absent, failed) = (sensor.no_echo_percent, sensor.absent_percent, sensor.failed_percent);
            writeln!(f, "{no_echo:>6.1}% {absent:>6.1}% {failed:>6.1}% {:>15}", sensor.longest_repeat)?;
        }
        match &self.damage {
            Some(damage) => write!(f, "damage     {damage}"),
            None => write!(f, "damage     none"),
        }
    }
}
