//! The saved state of the walls: those in the filter and those out of it.

use super::beam_model::Side;
use super::ekf_slam::{EkfSlam, WallLandmark};
use super::filter::Filter;
use super::inactive_landmarks::{InactiveLandmark, InactiveLandmarks};
use super::params::Params;
use crate::saved_state::{InactiveLandmarkState, InvalidState, LandmarkState, SavedState};

impl EkfSlam {
    /// The walls as plain numbers: those in the filter, in its order, and those out of it.
    #[must_use]
    pub fn landmark_states(&self) -> (Vec<LandmarkState>, Vec<InactiveLandmarkState>) {
        let inactive = self.inactive.iter().map(|inactive| InactiveLandmarkState {
            wall: inactive.wall.saved_state(),
            offset_m: inactive.offset_m,
            variance: inactive.variance,
        });
        (self.walls().iter().map(WallLandmark::saved_state).collect(), inactive.collect())
    }

    /// The state that was saved, without candidates for new walls.
    ///
    /// # Errors
    /// Where the numbers do not fit together or are not finite.
    pub fn restore(saved: &SavedState) -> Result<Self, InvalidState> {
        Self::restore_with_params(&Params::default(), saved)
    }

    /// The same with other constants.
    ///
    /// # Errors
    /// Where the numbers do not fit together or are not finite.
    pub fn restore_with_params(params: &Params, saved: &SavedState) -> Result<Self, InvalidState> {
        if saved.walls.len() != saved.filter.offsets_m.len() {
            return Err(InvalidState("the filter holds another number of walls than are described"));
        }
        let filter = Filter::restore(params.filter, &saved.filter)?;
        let walls = saved.walls.iter().map(WallLandmark::restore).collect::<Result<Vec<_>, _>>()?;
        let inactive = saved.inactive.iter().map(|inactive| {
            if !(inactive.offset_m.abs() < 1e6 && (0.0..1e6).contains(&inactive.variance)) {
                return Err(InvalidState("a wall's offset or variance is out of range"));
            }
            let wall = WallLandmark::restore(&inactive.wall)?;
            Ok(InactiveLandmark { wall, offset_m: inactive.offset_m, variance: inactive.variance })
        });
        let inactive = inactive.collect::<Result<Vec<_>, _>>()?;
        let mut slam = Self::with_params(params, filter.pose(), 0.0, saved.filter.nominal);
        (slam.filter, slam.walls, slam.inactive) = (filter, walls, InactiveLandmarks::new(params.inactive, inactive));
        Ok(slam)
    }

    /// True where the walls are known and do not change.
    #[must_use]
    pub fn is_frozen(&self) -> bool {
        self.is_frozen
    }

    /// Freezes the walls: from now on the filter localizes the robot among them and changes none.
    pub fn freeze_walls(&mut self) {
        self.is_frozen = true;
        self.filter.freeze_walls();
        self.inactive.freeze();
    }
}

impl WallLandmark {
    fn saved_state(&self) -> LandmarkState {
        LandmarkState { side: self.side.index(), lo_m: self.lo_m, hi_m: self.hi_m, hits: self.hits }
    }

    fn restore(saved: &LandmarkState) -> Result<Self, InvalidState> {
        let side = Side::ALL.into_iter().find(|side| side.index() == saved.side);
        let side = side.ok_or(InvalidState("a wall has no side: 0 to 3 are +x, +y, −x, −y"))?;
        if !(saved.lo_m.abs() < 1e6 && saved.hi_m.abs() < 1e6) {
            return Err(InvalidState("a wall's extent is out of range"));
        }
        Ok(Self {
            side,
            lo_m: saved.lo_m,
            hi_m: saved.hi_m,
            hits: saved.hits,
            last_sweep: 0,
            first_sweep: None,
            against: 0,
        })
    }
}
