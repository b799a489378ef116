//! Sensor fault detection: collects the evidence of one sweep and gives it to the [`FaultTest`] of each sensor.
//!
//! The evidence is what the board reports, what PCA over three instants leaves unexplained ([`super::pca`]), what the neighbours
//! see ([`super::neighbours`]), and what the map expects. All but the map's works from the first sweeps on, without a pose.

use super::evidence::{Evidence, Expected};
use super::fault_test::FaultTest;
use super::neighbours::Neighbours;
use super::params::Params;
use super::pca::{PcaBlock, cauchy_weight};
use crate::event::{Event, FaultEvent, SensorState};
use crate::geometry::Ring;
use crate::saved_state::{InvalidState, SensorHistory};
use crate::sweep::{Beam, NoMeasurement, Sweep};

/// Watches all sensors.
#[derive(Clone, Debug)]
pub struct Detector {
    params: Params,
    pca: PcaBlock,
    neighbours: Neighbours,
    sensors: Vec<FaultTest>,
    states: Vec<SensorState>,
    last_m: Vec<f64>,
    /// By sensor: what this sweep tells; scratch.
    evidence: Vec<Option<Evidence>>,
    /// True once a wheel has turned: without encoders, changing readings mean that the robot drives.
    has_wheels: bool,
    max_range_m: f64,
    /// Standard deviation of a sound sensor's reading, metres.
    range_sigma_m: f64,
    /// True while so many sensors look faulty at once that the pose, the map or the noise is suspected instead.
    is_ring_suspect: bool,
}

impl Detector {
    /// A detector for a ring whose sensors all begin healthy.
    #[must_use]
    pub fn new(ring: &Ring, max_range_m: f64) -> Self {
        Self::with_params(ring, max_range_m, Params::default())
    }

    /// The same with other constants.
    #[must_use]
    pub fn with_params(ring: &Ring, max_range_m: f64, params: Params) -> Self {
        Self {
            pca: PcaBlock::new(ring.len(), max_range_m),
            neighbours: Neighbours::new(ring, &params),
            sensors: vec![FaultTest::default(); ring.len()],
            states: vec![SensorState::Healthy; ring.len()],
            last_m: vec![f64::NAN; ring.len()],
            evidence: vec![None; ring.len()],
            has_wheels: false,
            max_range_m,
            range_sigma_m: 0.0,
            is_ring_suspect: false,
            params,
        }
    }

    /// Sets the standard deviation of a sound sensor's reading, metres.
    pub fn set_range_sigma(&mut self, range_sigma_m: f64) {
        self.range_sigma_m = range_sigma_m;
    }

    /// True while more than a third of the ring looks faulty by what pose, map or noise make of the readings: then these are suspected
    /// first, and no further sensor is declared faulty for that.
    #[must_use]
    pub fn is_ring_suspect(&self) -> bool {
        self.is_ring_suspect
    }

    /// Each sensor's state.
    #[must_use]
    pub fn states(&self) -> &[SensorState] {
        &self.states
    }

    /// What is known of the sensors, by id.
    #[must_use]
    pub fn saved_state(&self) -> Vec<SensorHistory> {
        self.sensors.iter().map(FaultTest::saved_state).collect()
    }

    /// Restores the sensors' states; each keeps its state until new readings disprove it.
    ///
    /// # Errors
    /// A sensor's state is impossible.
    pub fn restore(&mut self, sensors: &[SensorHistory]) -> Result<(), InvalidState> {
        // All are looked at: the ring may become known later.
        let remembered =
            sensors.iter().map(|sensor| FaultTest::restore(sensor, &self.params)).collect::<Result<Vec<_>, _>>()?;
        for (fault_test, remembered) in self.sensors.iter_mut().zip(remembered) {
            *fault_test = remembered;
        }
        for (state, SensorHistory { state: remembered, .. }) in self.states.iter_mut().zip(sensors) {
            *state = *remembered;
        }
        Ok(())
    }

    /// The evidence against a sensor: its strongest log-likelihood ratio; from 6 on the sensor is faulty. NaN where there is no such sensor.
    #[must_use]
    pub fn score(&self, sensor: usize) -> f64 {
        self.sensors.get(sensor).map_or(f64::NAN, FaultTest::score)
    }

    /// Root of what PCA leaves unexplained of a sensor's last readings, metres.
    #[must_use]
    pub fn residual_m(&self, sensor: usize) -> f64 {
        self.pca.residuals_m2().get(sensor).map_or(f64::NAN, |m2| m2.sqrt())
    }

    /// True where the sensor's readings may be used.
    #[must_use]
    pub fn is_trusted(&self, sensor: usize) -> bool {
        self.states.get(sensor) == Some(&SensorState::Healthy)
    }

    /// Adds one sweep's evidence. `expected` is what a beam must hear according to the map; only silent beams ask for it.
    pub fn inspect(&mut self, sweep: &Sweep, expected: impl Fn(&Beam) -> Option<Expected>, events: &mut Vec<Event>) {
        let has_residuals = self.pca.push(sweep);
        if has_residuals {
            self.pca.analyse(|_, variation_m2| cauchy_weight(variation_m2, self.params.calm_m2).powi(2));
        }
        self.has_wheels |= sweep.left_m != 0.0 || sweep.right_m != 0.0;
        let stirred_m = if self.has_wheels { 0.0 } else { self.stirred_m(sweep) };
        let moved_m = 0.5 * (sweep.left_m + sweep.right_m).abs()
            + self.params.lever_m * turn_rad(sweep, self.params.wheel_base_m).abs();
        for (sensor, beam) in sweep.beams.iter().enumerate().take(self.sensors.len()) {
            if beam.no_measurement == Some(NoMeasurement::Lost) {
                continue;
            }
            let seen = self.neighbours.seen(sensor, sweep, |other| self.is_trusted(other));
            let seen = seen.filter(|seen| seen.range_m < self.params.sure_part * self.max_range_m);
            let evidence = Evidence {
                range_m: beam.range_m,
                no_measurement: beam.no_measurement,
                residual_m: if has_residuals { self.pca.residuals_m2()[sensor].sqrt() } else { f64::NAN },
                expected: if beam.is_clear() { expected(beam) } else { None },
                neighbours: seen,
                moved_m: moved_m.max(stirred_m),
                leap_m: self.params.leap_m.max(self.params.leap_sigmas * self.range_sigma_m).max(moved_m),
                unexplained_m: self
                    .params
                    .unexplained_m
                    .max(self.params.unexplained_sigmas * self.range_sigma_m)
                    .max(self.params.unexplained_share * moved_m),
                passed_m: passed_m(sweep, beam, seen.map_or(0.0, |seen| seen.range_m), self.params.wheel_base_m)
                    .max(self.params.passed_while_stirred * stirred_m),
            };
            self.sensors[sensor].weigh(&evidence, &self.params);
            self.evidence[sensor] = Some(evidence);
        }
        self.judge(sweep, events);
    }

    /// The verdicts after all sensors have been weighed.
    fn judge(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let is_apparent = |test: &&FaultTest| test.is_apparently_faulty(&self.params);
        let apparent = self.sensors.iter().filter(is_apparent).count();
        self.is_ring_suspect = apparent > self.params.max_apparent.max(self.sensors.len() / 3);
        for (sensor, fault_test) in self.sensors.iter_mut().enumerate() {
            let Some(evidence) = self.evidence[sensor].take() else { continue };
            let state = fault_test.verdict(&self.params, !self.is_ring_suspect);
            if state != self.states[sensor] {
                self.states[sensor] = state;
                let reason = fault_test.reason(sensor, &evidence);
                events.push(Event::Fault(FaultEvent { at: sweep.at, sensor, state, reason }));
            }
        }
    }

    /// Mean change of the trusted sensors' readings since the last sweep, metres: it shows the robot's motion even
    /// without encoders.
    fn stirred_m(&mut self, sweep: &Sweep) -> f64 {
        let (mut sum_m, mut count) = (0.0, 0.0);
        for (sensor, (beam, last_m)) in sweep.beams.iter().zip(&mut self.last_m).enumerate() {
            let change_m = (beam.range_m - *last_m).abs();
            if change_m.is_finite() && self.states[sensor] == SensorState::Healthy {
                sum_m += change_m.min(self.params.max_change_m);
                count += 1.0;
            }
            *last_m = beam.range_m;
        }
        if count > 0.0 { sum_m / count } else { 0.0 }
    }
}

/// How far the robot has turned since the last sweep, radians, counter-clockwise.
fn turn_rad(sweep: &Sweep, base_m: f64) -> f64 {
    (sweep.right_m - sweep.left_m) / base_m
}

/// How far the point a beam looks at, `range_m` ahead, has moved across the beam since the last sweep, metres.
fn passed_m(sweep: &Sweep, beam: &Beam, range_m: f64, base_m: f64) -> f64 {
    let forward_m = 0.5 * (sweep.left_m + sweep.right_m);
    (turn_rad(sweep, base_m) * range_m - forward_m * libm::sin(beam.robot_from_sensor.theta_rad)).abs()
}
