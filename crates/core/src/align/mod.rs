//! Alignment: turns messages with board time into sweeps with host time.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod air;
pub(crate) mod clock;
mod decade;
mod flight_unit;
pub(crate) mod params;
mod ring_check;
mod stamps;
pub(crate) mod sweeper;
pub(crate) mod track;
pub(crate) mod trouble;
pub(crate) mod wheel_steps;

use crate::config::{CorrectionConfig, RingConfig};
use crate::geometry::Ring;
use crate::sweep::Sweep;
use crate::time::{DeviceTime, Timestamp};
use air::Air;
use clock::{ClockMap, Widener};
use flight_unit::FlightUnit;
use params::Params;
use ring_check::RingCheck;
use slamd_protocol::{Encoder, Sonar};
use stamps::Stamps;
use std::collections::VecDeque;
use std::ops::RangeInclusive;
use sweeper::Sweeper;
use track::{Track, Wheels};
use trouble::Trouble;

/// Turns the board's messages into sweeps. Idle until the ring and the wheels are known.
#[derive(Clone, Debug)]
pub struct Aligner {
    widener: Widener,
    clock: ClockMap,
    track: Track,
    wheels: Option<Wheels>,
    sweeper: Option<Sweeper>,
    corrections: Vec<CorrectionConfig>,
    range_m: RangeInclusive<f64>,
    air: Air,
    /// Stamps of groups and counts, and those of the answers to time requests.
    stamps: Stamps,
    answers: Stamps,
    check: RingCheck,
    unit: FlightUnit,
    range_scale: f64,
    has_run_back: bool,
    /// Since when stamps are behind.
    back_since: Option<Timestamp>,
    refused_stamps: u64,
    troubles: VecDeque<Trouble>,
    newest: Timestamp,
    params: Params,
}

/// The board restarted: its clock jumped back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restarted;

impl Aligner {
    /// An aligner for the configured sensors, with the default tuning.
    #[must_use]
    pub fn new(ring: &RingConfig) -> Self {
        Self::with_params(ring, f64::INFINITY, Params::default())
    }

    /// An aligner for the configured sensors, of a robot whose highest speed is `max_speed_m_s`; infinite: wheels may jump.
    #[must_use]
    pub fn with_params(ring: &RingConfig, max_speed_m_s: f64, params: Params) -> Self {
        Self {
            widener: Widener::new(params),
            clock: ClockMap::new(params),
            track: Track::new(max_speed_m_s, params),
            wheels: None,
            sweeper: None,
            corrections: ring.corrections.clone(),
            range_m: ring.min_range_m..=ring.max_range_m,
            air: Air::new(ring.temperature_c, params),
            stamps: Stamps::new(params),
            answers: Stamps::new(params),
            check: RingCheck::new(0, params),
            unit: FlightUnit::new(ring.range_scale, ring.max_range_m, params),
            range_scale: ring.range_scale,
            has_run_back: false,
            back_since: None,
            refused_stamps: 0,
            troubles: VecDeque::new(),
            newest: Timestamp::default(),
            params,
        }
    }

    /// Sets the ring. A ring that differs from the one before starts new sweeps.
    pub fn set_ring(&mut self, ring: Ring) {
        if self.ring() != Some(&ring) {
            let (range_m, temperature_c) = (self.range_m.clone(), self.air.celsius());
            self.check = RingCheck::new(ring.len(), self.params);
            let mut sweeper = Sweeper::new(ring, &self.corrections, range_m, temperature_c, self.params);
            sweeper.scale_ranges(self.range_scale);
            self.sweeper = Some(sweeper);
        }
    }

    /// The ring, once known.
    #[must_use]
    pub fn ring(&self) -> Option<&Ring> {
        self.sweeper.as_ref().map(Sweeper::ring)
    }

    /// The last finished sweep.
    #[must_use]
    pub fn sweep(&self) -> Option<&Sweep> {
        self.sweeper.as_ref().map(Sweeper::sweep)
    }

    /// Sets the wheels.
    pub fn set_wheels(&mut self, wheels: Wheels) {
        self.wheels = Some(wheels);
    }

    /// Flips the sign of one encoder's counts from now on; 0 is the left one.
    pub fn reverse_encoder(&mut self, wheel: usize) {
        self.track.reverse(wheel);
    }

    /// The board measured the air temperature, degrees Celsius. An implausible one is not used.
    pub(crate) fn measured_air(&mut self, celsius: f64, at: Timestamp) {
        self.troubles.extend(self.air.measured(celsius, at));
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.set_temperature(self.air.celsius());
        }
    }

    /// What was wrong with the board's data, each kind a few times at most.
    pub(crate) fn take_trouble(&mut self) -> Option<Trouble> {
        self.troubles.pop_front().or_else(|| self.track.take_trouble().map(Trouble::Wheel))
    }

    /// Wheel steps across a wrap at 16 bits, and wheel steps that were not rolled.
    #[must_use]
    pub(crate) fn step_counts(&self) -> (u64, u64) {
        self.track.step_counts()
    }

    /// Messages that were not used because the board's clock ran backwards.
    #[must_use]
    pub(crate) fn refused_stamps(&self) -> u64 {
        self.refused_stamps
    }

    /// A stamp of a group or of counts in microseconds, whatever the board counts.
    #[must_use]
    pub(crate) fn stamp_us(&self, stamp: u32) -> u32 {
        self.stamps.microseconds(stamp)
    }

    /// Microseconds of flight per number that the board sends: 1, unless the readings show another unit.
    #[must_use]
    pub(crate) fn flight_factor(&self) -> f64 {
        self.unit.factor()
    }

    /// True over reported range where the readings show that they are ten times too short or too long; otherwise 1.
    #[must_use]
    pub(crate) fn range_factor(&self) -> f64 {
        self.unit.range_factor()
    }

    /// True while no reading lies beyond half a metre: the readings do not tell whether they are ten times too short.
    #[must_use]
    pub(crate) fn is_unit_open(&self) -> bool {
        self.unit.is_open()
    }

    /// Sweeps dropped because too few of their messages arrived.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.sweeper.as_ref().map_or(0, Sweeper::dropped)
    }

    /// A fired group arrived at `at`. `each` receives the sweeps that it completes: the previous cycle, if this group starts a
    /// new one, and its own, if it is the last.
    ///
    /// # Errors
    /// `Restarted` if its stamp jumped back; call [`Aligner::restart`].
    pub fn sonar(&mut self, sonar: &Sonar, at: Timestamp, mut each: impl FnMut(&Sweep)) -> Result<(), Restarted> {
        let Some(trigger) = self.stamped(sonar.t_us, at)? else { return Ok(()) };
        let (Some(wheels), true) = (self.wheels, self.sweeper.is_some()) else {
            return Ok(());
        };
        if self.sweeper.as_ref().is_some_and(|sweeper| sweeper.has_heard(sonar.group)) {
            self.finish(at, wheels, &mut each);
        }
        self.troubles.extend(self.check.take(sonar));
        self.troubles.extend(self.unit.take(sonar));
        self.track.add(trigger, sonar.left_ticks, sonar.right_ticks, wheels);
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.add(sonar, trigger, |us| self.unit.microseconds(us));
        }
        if sonar.last_of_cycle {
            self.finish(at, wheels, &mut each);
        }
        Ok(())
    }

    /// Encoder counts arrived at `at`.
    ///
    /// # Errors
    /// `Restarted` if their stamp jumped back; call [`Aligner::restart`].
    pub fn encoder(&mut self, encoder: &Encoder, at: Timestamp) -> Result<(), Restarted> {
        let Some(latched) = self.stamped(encoder.t_us, at)? else { return Ok(()) };
        if let Some(wheels) = self.wheels {
            self.track.add(latched, encoder.left_ticks, encoder.right_ticks, wheels);
        }
        Ok(())
    }

    /// The board answered a time request sent at `sent`; the answer arrived at `at`.
    ///
    /// # Errors
    /// `Restarted` if its stamps jumped back; call [`Aligner::restart`].
    pub fn round_trip(&mut self, sent: Timestamp, rx_us: u32, tx_us: u32, at: Timestamp) -> Result<(), Restarted> {
        self.troubles.extend(self.answers.take(rx_us, at));
        let (rx_us, tx_us) = (self.answers.microseconds(rx_us), self.answers.microseconds(tx_us));
        let (Some(received), Some(answered)) = (self.widener.widen(rx_us), self.widener.widen(tx_us)) else {
            return self.jumped_back(at);
        };
        self.clock.round_trip(sent, received, answered, at);
        Ok(())
    }

    /// True if a message stamped `t_us` that arrived at `at` continues the board's clock, or if that clock is unknown.
    #[must_use]
    pub fn continues(&self, t_us: u32, at: Timestamp) -> bool {
        let stamp = self.widener.clone().widen(self.stamps.microseconds(t_us));
        let expected = stamp.map(|stamp| self.clock.host_time(stamp));
        match expected {
            None => false,
            Some(None) => true,
            Some(Some(expected)) => at.seconds_since(expected).abs() < self.params.continues_s,
        }
    }

    /// The board restarted: its clock and counters start again, the robot stays in place.
    pub fn restart(&mut self) {
        self.widener.reset();
        self.clock.reset();
        self.back_since = None;
        self.track.restart();
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.restart();
        }
    }

    /// The board time of a message; none if its stamp must not be used.
    fn stamped(&mut self, t_us: u32, at: Timestamp) -> Result<Option<DeviceTime>, Restarted> {
        self.troubles.extend(self.stamps.take(t_us, at));
        let newest = self.widener.newest();
        let Some(stamp) = self.widener.widen(self.stamps.microseconds(t_us)) else {
            return self.jumped_back(at).map(|()| None);
        };
        if self.runs_back(stamp, newest, at) {
            self.refused_stamps += 1;
            return Ok(None);
        }
        if self.clock.is_impossible(stamp, at) {
            self.clock.reset();
        }
        self.clock.arrived(stamp, at);
        Ok(Some(stamp))
    }

    /// True for a stamp that lies behind earlier ones, and for those after it until they fit the host's clock again: a clock that was
    /// set back catches up with its own past.
    fn runs_back(&mut self, stamp: DeviceTime, newest: Option<DeviceTime>, at: Timestamp) -> bool {
        let Params { back_s: bound_s, max_back_s, .. } = self.params;
        let back_s = newest.map_or(0.0, |newest| newest.seconds_since(stamp));
        if back_s > bound_s {
            self.back_since.get_or_insert(at);
            if self.stamps.is_known(at) && !std::mem::replace(&mut self.has_run_back, true) {
                self.troubles.push_back(Trouble::ClockRunsBack(back_s));
            }
            return true;
        }
        let Some(since) = self.back_since else { return false };
        if at.seconds_since(since) > max_back_s {
            // The clock stays back: from here on it is the clock.
            self.clock.reset();
        } else if self.clock.host_time(stamp).is_some_and(|sent| at.seconds_since(sent) > bound_s) {
            return true;
        }
        self.back_since = None;
        false
    }

    /// A stamp is far behind another one: the board restarted, unless one of the two may have another unit.
    fn jumped_back(&mut self, at: Timestamp) -> Result<(), Restarted> {
        if self.stamps.is_known(at) && self.answers.is_known(at) { Err(Restarted) } else { Ok(()) }
    }

    fn finish(&mut self, now: Timestamp, wheels: Wheels, each: &mut impl FnMut(&Sweep)) {
        let Some(sweeper) = &mut self.sweeper else { return };
        let Some(reference) = sweeper.reference() else { return };
        // A ping cannot arrive before it was sent, and a better clock line must not move time back.
        let host = self.clock.host_time(reference).unwrap_or(now).min(now);
        let at = host.max(Timestamp::from_us(self.newest.us().saturating_add(1)));
        if let Some(sweep) = sweeper.finish(at, &self.track, wheels) {
            self.newest = at;
            self.unit.rolled(sweep.left_m, sweep.right_m);
            each(sweep);
        }
    }
}
