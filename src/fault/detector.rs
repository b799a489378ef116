//! Which sensors to distrust: gathers the evidence of one sweep and lets [`Suspicion`] weigh it, sensor by sensor.
//!
//! The evidence is what the board reports, what PCA over three instants leaves unexplained ([`super::pca`]), what the neighbours
//! see ([`super::neighbours`]), and what the map expects. All but the map's is there from the first sweeps on, without a pose.

use super::neighbours::Neighbours;
use super::pca::{PcaBlock, trust};
use super::suspicion::{Evidence, Suspicion};
use crate::event::{Event, FaultEvent, SensorState};
use crate::geometry::Ring;
use crate::sweep::{NoMeasurement, Sweep};

/// Watches all sensors.
#[derive(Clone, Debug)]
pub struct Detector {
    pca: PcaBlock,
    neighbours: Neighbours,
    sensors: Vec<Suspicion>,
    states: Vec<SensorState>,
    last_m: Vec<f64>,
    max_range_m: f64,
}

/// The variation from which on a sensor loses its say in the first component.
const CALM_M2: f64 = 0.01;
/// A wall nearer to the farthest range than this may well be missed, metres.
const MARGIN_M: f64 = 0.3;
/// A turning robot's beams sweep over the walls: wheels that part by one metre count as this many.
const MOVED_BY_TURN: f64 = 1.7;
/// A reading's change counts as motion up to this, metres: what jumps farther has looked at something else.
const MOST_CHANGE_M: f64 = 0.1;

impl Detector {
    /// A detector for a ring whose sensors all begin healthy.
    #[must_use]
    pub fn new(ring: &Ring, max_range_m: f64) -> Self {
        Self {
            pca: PcaBlock::new(ring.len(), max_range_m),
            neighbours: Neighbours::new(ring),
            sensors: vec![Suspicion::default(); ring.len()],
            states: vec![SensorState::Healthy; ring.len()],
            last_m: vec![f64::NAN; ring.len()],
            max_range_m,
        }
    }

    /// Each sensor's state.
    #[must_use]
    pub fn states(&self) -> &[SensorState] {
        &self.states
    }

    /// True where the sensor's readings may be used.
    #[must_use]
    pub fn is_trusted(&self, sensor: usize) -> bool {
        self.states.get(sensor) == Some(&SensorState::Healthy)
    }

    /// Weighs one sweep. `expected_m` is the range at which a healthy sensor must hear a wall of the map.
    pub fn inspect(&mut self, sweep: &Sweep, expected_m: impl Fn(usize) -> Option<f64>, events: &mut Vec<Event>) {
        let has_residuals = self.pca.push(sweep);
        if has_residuals {
            self.pca.analyse(|_, variation_m2| trust(variation_m2, CALM_M2));
        }
        let moved_m = self.moved_m(sweep);
        for (sensor, beam) in sweep.beams.iter().enumerate().take(self.sensors.len()) {
            if beam.no_measurement == Some(NoMeasurement::Lost) {
                continue;
            }
            let is_near = |range_m: &f64| *range_m < self.max_range_m - MARGIN_M;
            let seen = self.neighbours.seen(sensor, sweep, |other| self.is_trusted(other));
            let evidence = Evidence {
                range_m: beam.range_m,
                no_measurement: beam.no_measurement,
                residual_m: if has_residuals { self.pca.residuals_m2()[sensor].sqrt() } else { f64::NAN },
                map_m: expected_m(sensor).filter(is_near),
                neighbours: seen.filter(|seen| is_near(&seen.range_m)),
                moved_m,
            };
            let suspicion = &mut self.sensors[sensor];
            suspicion.weigh(&evidence);
            let state = suspicion.verdict();
            if state != self.states[sensor] {
                self.states[sensor] = state;
                let reason = suspicion.reason(sensor, &evidence);
                events.push(Event::Fault(FaultEvent { at: sweep.at, sensor, state, reason }));
            }
        }
    }

    /// How far the robot has moved since the last sweep, metres: by its wheels or, where those say nothing, by how the trusted
    /// sensors' readings have changed on average.
    fn moved_m(&mut self, sweep: &Sweep) -> f64 {
        let (mut sum_m, mut count) = (0.0, 0.0);
        for (sensor, (beam, last_m)) in sweep.beams.iter().zip(&mut self.last_m).enumerate() {
            let change_m = (beam.range_m - *last_m).abs();
            if change_m.is_finite() && self.states[sensor] == SensorState::Healthy {
                sum_m += change_m.min(MOST_CHANGE_M);
                count += 1.0;
            }
            *last_m = beam.range_m;
        }
        let by_wheels_m =
            0.5 * (sweep.left_m + sweep.right_m).abs() + MOVED_BY_TURN * (sweep.right_m - sweep.left_m).abs();
        if count > 0.0 { by_wheels_m.max(sum_m / count) } else { by_wheels_m }
    }
}
