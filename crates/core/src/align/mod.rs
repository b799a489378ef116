//! Alignment: messages with board time in, sweeps with host time out.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

pub mod clock;
pub mod sweeper;
pub mod track;

use crate::config::{CorrectionConfig, RingConfig};
use crate::geometry::Ring;
use crate::sweep::Sweep;
use crate::time::{DeviceTime, Timestamp};
use clock::{ClockMap, Widener};
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
}

/// A message is never this late, and a rate learnt within a minute is not this wrong after an hour of silence, seconds.
const CONTINUES_S: f64 = 0.5;

/// The board's clock has jumped back: it has restarted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restarted;

impl Aligner {
    /// An aligner for sensors as configured.
    #[must_use]
    pub fn new(ring: &RingConfig) -> Self {
        Self {
            widener: Widener::default(),
            clock: ClockMap::default(),
            track: Track::default(),
            wheels: None,
            sweeper: None,
            corrections: ring.corrections.clone(),
            range_m: ring.min_range_m..=ring.max_range_m,
            temperature_c: ring.temperature_c,
            newest: Timestamp::default(),
        }
    }

    /// The ring is known; a ring that differs from the one before begins its sweeps anew.
    pub fn set_ring(&mut self, ring: Ring) {
        if self.ring() != Some(&ring) {
            self.sweeper = Some(Sweeper::new(ring, &self.corrections, self.range_m.clone(), self.temperature_c));
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

    /// The wheels are known.
    pub fn set_wheels(&mut self, wheels: Wheels) {
        self.wheels = Some(wheels);
    }

    /// From now on one encoder's counts, 0 for the left, are taken with the sign turned over.
    pub fn reverse_encoder(&mut self, wheel: usize) {
        self.track.reverse(wheel);
    }

    /// The board has measured the air's temperature.
    pub fn set_temperature(&mut self, temperature_c: f64) {
        self.temperature_c = temperature_c;
        if let Some(sweeper) = &mut self.sweeper {
            sweeper.set_temperature(temperature_c);
        }
    }

    /// Sweeps given up because too few of their messages arrived.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.sweeper.as_ref().map_or(0, Sweeper::dropped)
    }

    /// A fired group has arrived at `at`; `each` sees the sweeps that it completes: the cycle before, if this group begins a new one,
    /// and its own, if it is the last.
    ///
    /// # Errors
    /// [`Restarted`] where its stamp says so; call [`Aligner::restart`].
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

    /// Encoder counts have arrived at `at`.
    ///
    /// # Errors
    /// [`Restarted`] where their stamp says so; call [`Aligner::restart`].
    pub fn encoder(&mut self, encoder: &Encoder, at: Timestamp) -> Result<(), Restarted> {
        let latched = self.stamped(encoder.t_us, at)?;
        if let Some(wheels) = self.wheels {
            self.track.add(latched, encoder.left_ticks, encoder.right_ticks, wheels);
        }
        Ok(())
    }

    /// The board received a time request that left at `sent`, and its answer came at `at`.
    ///
    /// # Errors
    /// [`Restarted`] where its stamps say so; call [`Aligner::restart`].
    pub fn round_trip(&mut self, sent: Timestamp, rx_us: u32, tx_us: u32, at: Timestamp) -> Result<(), Restarted> {
        let received = self.widener.widen(rx_us).ok_or(Restarted)?;
        let answered = self.widener.widen(tx_us).ok_or(Restarted)?;
        self.clock.round_trip(sent, received, answered, at);
        Ok(())
    }

    /// True where a message stamped `t_us` that has arrived at `at` continues the board's clock, as far as that is known.
    #[must_use]
    pub fn continues(&self, t_us: u32, at: Timestamp) -> bool {
        let stamp = self.widener.clone().widen(t_us);
        let expected = stamp.map(|stamp| self.clock.host_time(stamp));
        match expected {
            None => false,
            Some(None) => true,
            Some(Some(expected)) => at.seconds_since(expected).abs() < CONTINUES_S,
        }
    }

    /// The board has restarted: its clock and its counters begin anew, the robot is where it was.
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
        // No ping is heard before it is sent, and a better clock line must not turn time back.
        let host = self.clock.host_time(reference).unwrap_or(now).min(now);
        let at = host.max(Timestamp::from_us(self.newest.us().saturating_add(1)));
        if let Some(sweep) = sweeper.finish(at, &self.track, wheels) {
            self.newest = at;
            each(sweep);
        }
    }
}
