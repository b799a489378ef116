//! Writes updates to Rerun. Everything runs on the sink's own thread, because Rerun's times are
//! thread-local and logging may block.

use super::known::Known;
use super::layout::{self, Eye};
use super::mailbox::{Inbox, LogLine, NewMap, SinkUpdate};
use super::snapshot::Snapshot;
use super::{shapes, style};
use rerun::{RecordingStream, RecordingStreamResult, Scalars, StateChange, TextLog};
use slamd_core::{SensorState, Timestamp};
use std::sync::Arc;

/// Writes updates to a Rerun stream. Without a stream it only keeps their state.
pub(super) struct RerunWriter {
    known: Known,
    rec: Option<RecordingStream>,
    /// Microseconds from 1970 to the session's time zero, where known.
    unix_zero_us: Option<u64>,
    /// Time of the last drawing of map, paths and rates.
    slow: Option<Timestamp>,
    has_new_map: bool,
    /// Time of the last drawing of everything.
    everything: Option<Timestamp>,
}

/// Period of drawing map, paths and rates, seconds.
const SLOW_PERIOD_S: f64 = 1.0;
/// Period of drawing everything again, seconds, because a server forgets old data.
const EVERYTHING_PERIOD_S: f64 = 30.0;

impl RerunWriter {
    /// A writer without a stream.
    #[must_use]
    pub(super) fn new(unix_zero_us: Option<u64>) -> Self {
        Self { known: Known::default(), rec: None, unix_zero_us, slow: None, has_new_map: false, everything: None }
    }

    /// Begins to write to a new stream, with everything known so far.
    ///
    /// # Errors
    /// As Rerun reports them.
    pub(super) fn begin(&mut self, rec: RecordingStream) -> RecordingStreamResult<()> {
        layout::send(&rec, self.eye())?;
        style::log(&rec)?;
        // Logs before the first sweep get time zero.
        rec.set_duration_secs("robot_time", 0.0);
        rec.set_time_sequence("sweep", 0);
        self.rec = Some(rec);
        self.everything = None;
        if let Some(newest) = self.known.newest.clone() {
            self.set_time(&newest);
            self.draw_known()?;
        }
        Ok(())
    }

    /// The stream, if there is one.
    #[must_use]
    pub(super) fn stream(&self) -> Option<&RecordingStream> {
        self.rec.as_ref()
    }

    /// Stops writing and returns the stream.
    pub(super) fn end(&mut self) -> Option<RecordingStream> {
        self.rec.take()
    }

    /// Moves the eye so that the whole map is in view: for the end of a session.
    ///
    /// # Errors
    /// As Rerun reports them.
    pub(super) fn show_whole_map(&self) -> RecordingStreamResult<()> {
        self.rec.as_ref().map_or(Ok(()), |rec| layout::send(rec, self.eye()))
    }

    /// Handles an update.
    ///
    /// # Errors
    /// As Rerun reports them.
    pub(super) fn take(&mut self, update: &SinkUpdate, inbox: &Inbox) -> RecordingStreamResult<()> {
        match update {
            SinkUpdate::Snapshot(snapshot) => self.snapshot(snapshot, inbox),
            SinkUpdate::Truth(at, pose) => {
                self.known.truth(*at, *pose);
                Ok(())
            }
            SinkUpdate::LogLine(line) => self.line(line),
            SinkUpdate::Map(map) => {
                self.has_new_map |= self.known.chart.update(NewMap::clone(map));
                Ok(())
            }
        }
    }

    fn eye(&self) -> Eye {
        self.known.chart.picture().map_or_else(Eye::default, |picture| {
            let (middle, size) = picture.extent_m();
            Eye::over(middle, size)
        })
    }

    fn line(&self, line: &LogLine) -> RecordingStreamResult<()> {
        let Some(rec) = &self.rec else { return Ok(()) };
        rec.log(style::LOG, &TextLog::new(line.text.clone()).with_level(line.level))
    }

    fn snapshot(&mut self, snapshot: &Arc<Snapshot>, inbox: &Inbox) -> RecordingStreamResult<()> {
        let was_lost = self.known.is_lost;
        self.known.take(snapshot);
        self.set_time(snapshot);
        if self.known.is_lost != was_lost {
            self.draw_localization()?;
        }
        self.draw_ring(snapshot)?;
        self.draw_sweep(snapshot)?;
        let is_due =
            |last: Option<Timestamp>, period_s| last.is_none_or(|last| snapshot.at.seconds_since(last) >= period_s);
        if snapshot.beams.is_empty() || !is_due(self.slow, SLOW_PERIOD_S) {
            return Ok(());
        }
        self.slow = Some(snapshot.at);
        let has_new_map = self.known.chart.update(inbox.take_map()) | std::mem::take(&mut self.has_new_map);
        if is_due(self.everything, EVERYTHING_PERIOD_S) {
            return self.draw_known();
        }
        if let Some(rec) = &self.rec {
            rec.log(style::DROPS, &Scalars::single(inbox.dropped() as f64))?;
        }
        self.draw_slow(has_new_map)
    }

    fn set_time(&self, snapshot: &Snapshot) {
        let Some(rec) = &self.rec else { return };
        rec.set_time_sequence("sweep", i64::try_from(snapshot.sweep).unwrap_or(i64::MAX));
        rec.set_duration_secs("robot_time", snapshot.at.seconds());
        if let Some(zero_us) = self.unix_zero_us {
            let us = zero_us.saturating_add(snapshot.at.us());
            rec.set_timestamp_nanos_since_epoch(
                "host_time",
                i64::try_from(us).unwrap_or(i64::MAX).saturating_mul(1_000),
            );
        }
    }

    /// Draws the ring if it is new, and the states that changed.
    fn draw_ring(&mut self, snapshot: &Snapshot) -> RecordingStreamResult<()> {
        let known = &mut self.known;
        if !Arc::ptr_eq(&known.ring, &snapshot.ring) {
            known.ring = Arc::clone(&snapshot.ring);
            if let Some(rec) = &self.rec {
                style::log_ring(rec, &known.ring)?;
            }
        }
        known.sensors.resize(snapshot.beams.len().max(known.sensors.len()), (SensorState::Healthy, false));
        for (sensor, (beam, (state, is_shown))) in snapshot.beams.iter().zip(&mut known.sensors).enumerate() {
            if beam.state != *state {
                *state = beam.state;
                if let Some(rec) = &self.rec {
                    if !std::mem::replace(is_shown, true) {
                        style::log_lane(rec, sensor)?;
                    }
                    rec.log(style::lane(sensor), &StateChange::single(style::word(*state)))?;
                }
            }
        }
        Ok(())
    }

    /// Draws what changes with each sweep.
    fn draw_sweep(&self, snapshot: &Snapshot) -> RecordingStreamResult<()> {
        let Some(rec) = &self.rec else { return Ok(()) };
        if let Some(estimate) = &snapshot.estimate {
            rec.log(style::ODOM, &shapes::transform(estimate.pose * estimate.odometry.inverse()))?;
            rec.log(style::BASE_LINK, &shapes::transform(estimate.odometry))?;
            rec.log(style::ELLIPSE, &shapes::ellipse(estimate.pose, &estimate.covariance))?;
            rec.log(style::HEADING, &Scalars::new(self.known.headings_rad.map(f64::to_degrees)))?;
            if estimate.nis.is_finite() {
                rec.log(style::NIS, &Scalars::single(estimate.nis))?;
            }
        }
        if snapshot.segments.is_some() {
            self.draw_walls()?;
        }
        if snapshot.beams.is_empty() {
            return Ok(());
        }
        rec.log(style::CONES, &shapes::cones(&snapshot.beams))?;
        rec.log(style::ECHOES, &shapes::echoes(&snapshot.beams))?;
        rec.log(style::SCORES, &Scalars::new(snapshot.beams.iter().map(|beam| f64::from(beam.score))))?;
        rec.log(style::RESIDUALS, &Scalars::new(snapshot.beams.iter().map(|beam| f64::from(beam.residual_m))))?;
        rec.log(style::DELAYS, &Scalars::new([snapshot.latency, snapshot.took].map(|delay| 1e3 * delay.as_secs_f64())))
    }

    fn draw_slow(&mut self, has_new_map: bool) -> RecordingStreamResult<()> {
        let Some(rec) = &self.rec else { return Ok(()) };
        let known = &mut self.known;
        if let Some(picture) = has_new_map.then(|| known.chart.picture()).flatten() {
            rec.log(style::GRID, &shapes::grid(picture))?;
        }
        for (kind, trail) in known.trails.iter_mut().enumerate() {
            for (number, piece) in trail.take_new() {
                draw_piece(rec, kind, number, piece)?;
            }
        }
        let rates = known.rates;
        rec.log(
            style::RATES,
            &Scalars::new([rates.sweeps, rates.crc_errors, rates.lost_frames, rates.dropped_sweeps]),
        )?;
        if let Some(newest) = &known.newest {
            rec.log(style::SENSORS, &shapes::sensors(&newest.beams))?;
        }
        Ok(())
    }

    fn draw_walls(&self) -> RecordingStreamResult<()> {
        let (Some(rec), Some(segments)) = (&self.rec, &self.known.segments) else { return Ok(()) };
        rec.log(style::WALLS, &shapes::walls(segments))?;
        rec.log(style::WALL_BANDS, &shapes::wall_bands(segments))
    }

    fn draw_localization(&self) -> RecordingStreamResult<()> {
        let word = self.known.is_lost.map(|is_lost| if is_lost { style::LOST } else { style::KNOWN });
        let (Some(rec), Some(word)) = (&self.rec, word) else { return Ok(()) };
        rec.log(style::LOCALIZATION, &StateChange::single(word))
    }

    /// Draws everything, changed or not.
    fn draw_known(&mut self) -> RecordingStreamResult<()> {
        self.everything = self.known.newest.as_ref().map(|newest| newest.at);
        if let Some(rec) = &self.rec {
            style::log_ring(rec, &self.known.ring)?;
            for (sensor, (state, is_shown)) in self.known.sensors.iter_mut().enumerate() {
                if *is_shown || *state != SensorState::Healthy {
                    *is_shown = true;
                    style::log_lane(rec, sensor)?;
                    rec.log(style::lane(sensor), &StateChange::single(style::word(*state)))?;
                }
            }
            for (kind, trail) in self.known.trails.iter().enumerate() {
                for (number, piece) in trail.all() {
                    draw_piece(rec, kind, number, piece)?;
                }
            }
        }
        self.draw_localization()?;
        self.draw_walls()?;
        self.draw_slow(true)
    }
}

fn draw_piece(rec: &RecordingStream, kind: usize, number: usize, piece: &[[f32; 3]]) -> RecordingStreamResult<()> {
    let (colour, points) = match kind {
        0 => (style::TRUTH, 1.25),
        1 => (style::ODOMETRY, 1.5),
        _ => (style::ESTIMATED, 2.5),
    };
    rec.log(format!("{}/{number:03}", style::TRAILS[kind]), &shapes::trail(piece, colour, points))
}
