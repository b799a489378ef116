//! The filter's saved state.

use super::filter::{Filter, MAX_WALLS, ROBOT, Robot};
use super::params::FilterParams;
use crate::geometry::Pose2;
use crate::saved_state::{FilterState, InvalidState};

impl Filter {
    /// State and covariance as plain numbers.
    #[must_use]
    pub fn saved_state(&self) -> FilterState {
        let walls = self.walls();
        let mut covariance = Vec::with_capacity((ROBOT + walls) * (ROBOT + walls + 1) / 2);
        for row in 0..ROBOT {
            covariance.extend((0..=row).map(|column| self.robot_cov[(row, column)]));
        }
        for row in 0..walls {
            covariance.extend(self.cross[row].iter());
            covariance.extend_from_slice(self.wall_cov.row(row));
        }
        FilterState {
            robot: self.robot.iter().copied().collect(),
            offsets_m: self.offsets.clone(),
            covariance,
            nominal: self.nominal,
        }
    }

    /// The filter that was saved.
    ///
    /// # Errors
    /// Where the numbers do not fit together or are not finite.
    pub fn restore(params: FilterParams, saved: &FilterState) -> Result<Self, InvalidState> {
        let widened = with_travel(saved, params);
        let saved = widened.as_ref().unwrap_or(saved);
        let (walls, entries) = (saved.offsets_m.len(), saved.covariance.len());
        if saved.robot.len() != ROBOT || walls > MAX_WALLS || entries != (ROBOT + walls) * (ROBOT + walls + 1) / 2 {
            return Err(InvalidState("the filter's state and covariance are not of one size"));
        }
        let wheels = saved.nominal;
        let mut numbers = saved.robot.iter().chain(&saved.offsets_m).chain(&saved.covariance);
        let are_sizes = wheels.wheel_ratio > 0.0 && wheels.wheel_base_m > 0.0;
        if !(numbers.all(|number| number.abs() < 1e9) && are_sizes) {
            return Err(InvalidState("the filter's state is not made of usable numbers"));
        }
        let mut filter = Self::with_params(params, Pose2::default(), 0.0, saved.nominal);
        filter.robot.copy_from_slice(&saved.robot);
        let mut entries = saved.covariance.iter().copied();
        for row in 0..ROBOT {
            for column in 0..=row {
                let entry = entries.next().unwrap_or_default();
                (filter.robot_cov[(row, column)], filter.robot_cov[(column, row)]) = (entry, entry);
            }
        }
        filter.offsets.clone_from(&saved.offsets_m);
        for row in 0..walls {
            filter.cross.push(Robot::from_iterator(entries.by_ref().take(ROBOT)));
            let covariances = filter.wall_cov.row_mut(row);
            covariances.iter_mut().zip(entries.by_ref()).for_each(|(covariance, entry)| *covariance = entry);
        }
        let variances = (0..ROBOT).map(|i| filter.robot_cov[(i, i)]).chain((0..walls).map(|i| filter.wall_variance(i)));
        if variances.into_iter().any(|variance| variance < 0.0) {
            return Err(InvalidState("a variance of the filter is negative"));
        }
        Ok(filter)
    }

    /// Adds to the pose's covariance.
    pub fn inflate(&mut self, position_sigma_m: f64, heading_sigma_rad: f64) {
        self.robot_cov[(0, 0)] += position_sigma_m * position_sigma_m;
        self.robot_cov[(1, 1)] += position_sigma_m * position_sigma_m;
        self.robot_cov[(2, 2)] += heading_sigma_rad * heading_sigma_rad;
    }

    /// Sets the covariance of the walls to zero: updates change the robot only.
    pub fn freeze_walls(&mut self) {
        self.cross.fill(Robot::zeros());
        self.wall_cov.clear();
    }
}

/// A state that was saved before the travel was estimated, with its prior; none for a newer one.
fn with_travel(saved: &FilterState, params: FilterParams) -> Option<FilterState> {
    const OLD: usize = ROBOT - 1;
    if saved.robot.len() != OLD {
        return None;
    }
    let mut entries = saved.covariance.iter().copied();
    let mut covariance: Vec<f64> = entries.by_ref().take(OLD * (OLD + 1) / 2).collect();
    covariance.extend([0.0; OLD]);
    covariance.push(params.travel_sigma * params.travel_sigma);
    for wall in 0..saved.offsets_m.len() {
        covariance.extend(entries.by_ref().take(OLD));
        covariance.push(0.0);
        covariance.extend(entries.by_ref().take(wall + 1));
    }
    let robot = saved.robot.iter().copied().chain([0.0]).collect();
    Some(FilterState { robot, covariance, ..saved.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Calibration;

    #[test]
    fn a_state_without_travel_is_restored_with_its_prior() {
        let wheels =
            Calibration { wheel_ratio: 1.0, wheel_ratio_sigma: 0.01, wheel_base_m: 0.26, wheel_base_sigma_m: 0.006 };
        let params = FilterParams::default();
        let mut filter = Filter::with_params(params, Pose2::new(1.0, 2.0, 0.3), 0.05, wheels);
        let h_robot = Robot::from_element(0.1);
        filter.add(2.0, &h_robot, 1e-4);
        filter.add(-1.0, &h_robot, 1e-4);
        let mut old = filter.saved_state();
        assert_eq!((old.robot.len(), old.covariance.len()), (6, 36));
        // The travel is the sixth row, and the sixth entry of each wall's row.
        old.robot.pop();
        let kept = (0..36).filter(|entry| !(15..21).contains(entry) && *entry != 26 && *entry != 33);
        old.covariance = kept.map(|entry| old.covariance[entry]).collect();
        let restored = Filter::restore(params, &old).unwrap();
        assert_eq!(restored.walls(), 2);
        assert!((restored.travel_scale().1 - params.travel_sigma).abs() < 1e-12);
        assert!((restored.wall_variance(1) - filter.wall_variance(1)).abs() < 1e-12);
    }
}
