//! Alignment: turns messages with board time into sweeps with host time.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

pub(crate) mod clock;
pub(crate) mod params;
pub(crate) mod sweeper;
pub(crate) mod track;

use crate::config::{CorrectionConfig, RingConfig};
use crate::geometry::Ring;
use crate::sweep::Sweep;
use crate::time::{DeviceTime, Timestamp};
use clock::{ClockMap, Widener};
use params::Params;
use slamd_protocol::{Encoder, Sonar};
use std::ops::RangeInclusive;
use sweeper::Sweeper;
use track::{Track, Wheels};

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
    temperature_c: f64,
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
        Self::with_params(ring, Params::default())
    }

    /// An aligner for the configured sensors.
    #[must_use]
    pub fn with_params(ring: &RingConfig, params: Params) -> Self {
        Self {
            widener: Widener::new(params),
            clock: ClockMap::new(params),
            track: Track::new(params),
            wheels: None,
            sweeper: None,
            corrections: ring.corrections.clone(),
            range_m: ring.min_range_m..=ring.max_range_m,
            temperature_c: ring.temperature_c,
            newest: Timestamp::default(),
            params,
        }
    }

    /// Sets the ring. A ring that differs from the one before starts new sweeps.
    pub fn set_ring(&mut self, ring: Ring) {
        if self.ring() != Some(&ring) {
            let (range_m, temperature_c) = (self.range_m.clone(), self.temperature_c);
            self.sweeper = Some(Sweeper::new(ring, &self.corrections, range_m, temperature_c, self.params));
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

    /// Sets the air temperature.
    pub fn set_temperature(&mut self, temperature_c: f64) {
        self.temperature_c = temperature_c;
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.set_temperature(temperature_c);
        }
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
        let trigger = self.stamped(sonar.t_us, at)?;
        let (Some(wheels), true) = (self.wheels, self.sweeper.is_some()) else {
            return Ok(());
        };
        if self.sweeper.as_ref().is_some_and(|sweeper| sweeper.has_heard(sonar.group)) {
            self.finish(at, wheels, &mut each);
        }
        self.track.add(trigger, sonar.left_ticks, sonar.right_ticks, wheels);
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.add(sonar, trigger);
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
        let latched = self.stamped(encoder.t_us, at)?;
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
        let received = self.widener.widen(rx_us).ok_or(Restarted)?;
        let answered = self.widener.widen(tx_us).ok_or(Restarted)?;
        self.clock.round_trip(sent, received, answered, at);
        Ok(())
    }

    /// True if a message stamped `t_us` that arrived at `at` continues the board's clock, or if that clock is unknown.
    #[must_use]
    pub fn continues(&self, t_us: u32, at: Timestamp) -> bool {
        let stamp = self.widener.clone().widen(t_us);
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
        self.track.restart();
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.restart();
        }
    }

    fn stamped(&mut self, t_us: u32, at: Timestamp) -> Result<DeviceTime, Restarted> {
        let stamp = self.widener.widen(t_us).ok_or(Restarted)?;
        if self.clock.is_impossible(stamp, at) {
            self.clock.reset();
        }
        self.clock.arrived(stamp, at);
        Ok(stamp)
    }

    fn finish(&mut self, now: Timestamp, wheels: Wheels, each: &mut impl FnMut(&Sweep)) {
        let Some(sweeper) = &mut self.sweeper else { return };
        let Some(reference) = sweeper.reference() else { return };
        // A ping cannot arrive before it was sent, and a better clock line must not move time back.
        let host = self.clock.host_time(reference).unwrap_or(now).min(now);
        let at = host.max(Timestamp::from_us(self.newest.us().saturating_add(1)));
        if let Some(sweep) = sweeper.finish(at, &self.track, wheels) {
            self.newest = at;
            each(sweep);
        }
    }
}
