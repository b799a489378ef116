//! The sweeps since the start, to begin again with another robot.

use crate::sweep::{Beam, Sweep};

/// All sweeps of a drive so far, as long as they are few enough.
#[derive(Debug)]
pub(super) struct History {
    /// The sweeps without their beams; none once some are gone.
    sweeps: Option<Vec<Sweep>>,
    /// The beams of all of them, so that a sweep allocates nothing.
    beams: Vec<Beam>,
    max_sweeps: usize,
}

impl History {
    pub(super) const fn new(max_sweeps: usize) -> Self {
        Self { sweeps: Some(Vec::new()), beams: Vec::new(), max_sweeps }
    }

    /// Adds a sweep; a standing robot adds nothing after the first ones. The history of a long drive is given up.
    pub(super) fn push(&mut self, sweep: &Sweep, standing_sweeps: usize) {
        let Some(sweeps) = &mut self.sweeps else { return };
        if sweep.left_m == 0.0 && sweep.right_m == 0.0 && sweeps.len() >= standing_sweeps {
            return;
        }
        if sweeps.is_empty() {
            sweeps.reserve_exact(self.max_sweeps);
            self.beams.reserve_exact(self.max_sweeps * sweep.beams.len());
        }
        let is_another_ring = self.beams.len() != sweeps.len() * sweep.beams.len();
        if sweeps.len() == self.max_sweeps || is_another_ring {
            (self.sweeps, self.beams) = (None, Vec::new());
            return;
        }
        let Sweep { index, at, elapsed_s, odometry, left_m, right_m, ref beams } = *sweep;
        sweeps.push(Sweep { index, at, elapsed_s, odometry, left_m, right_m, beams: Vec::new() });
        self.beams.extend_from_slice(beams);
    }

    /// The number of sweeps; none if some are gone.
    pub(super) fn len(&self) -> Option<usize> {
        self.sweeps.as_ref().map(Vec::len)
    }

    /// All sweeps in order; none if some are gone.
    pub(super) fn sweeps(&self) -> impl Iterator<Item = Sweep> {
        let sweeps = self.sweeps.as_deref().unwrap_or_default();
        let sensors = self.beams.len() / sweeps.len().max(1);
        let beams = self.beams.chunks(sensors.max(1));
        sweeps.iter().zip(beams).map(|(sweep, beams)| Sweep { beams: beams.to_vec(), ..sweep.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(index: u64, sensors: usize) -> Sweep {
        let range_m = index as f64;
        let robot_from_sensor = crate::geometry::Pose2::default();
        let beam = Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor, half_angle_rad: 0.2 };
        Sweep { index, left_m: 0.01, beams: vec![beam; sensors], ..Sweep::default() }
    }

    #[test]
    fn sweeps_come_back_as_they_were() {
        let mut history = History::new(3);
        let sweeps: Vec<Sweep> = (0..3).map(|index| sweep(index, 4)).collect();
        sweeps.iter().for_each(|sweep| history.push(sweep, 1));
        assert_eq!((history.len(), history.sweeps().collect::<Vec<_>>()), (Some(3), sweeps));
        history.push(&sweep(3, 4), 1);
        assert_eq!((history.len(), history.sweeps().count()), (None, 0));
    }

    #[test]
    fn a_standing_robot_adds_its_first_sweeps() {
        let mut history = History::new(9);
        (0..5).for_each(|index| history.push(&Sweep { left_m: 0.0, ..sweep(index, 2) }, 2));
        assert_eq!(history.len(), Some(2));
    }
}
