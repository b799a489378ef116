//! What a tracker remembers: its walls, those in the filter and those out of observe_wall.

use super::beam_model::Side;
use super::ekf_slam::{EkfSlam, WallLandmark};
use super::filter::Filter;
use super::inactive_landmarks::{InactiveLandmark, InactiveLandmarks};
use crate::saved_state::{InactiveLandmarkState, InvalidState, LandmarkState, SavedState};

impl EkfSlam {
    /// The walls as plain numbers: those in the filter, in its order, and those out of its observe_wall.
    #[must_use]
    pub fn landmark_states(&self) -> (Vec<LandmarkState>, Vec<InactiveLandmarkState>) {
        let inactive = self.inactive.iter().map(|inactive| InactiveLandmarkState {
            wall: inactive.wall.saved_state(),
            offset_m: inactive.offset_m,
            variance: inactive.variance,
        });
        (self.walls().iter().map(WallLandmark::saved_state).collect(), inactive.collect())
    }

    /// The tracker that wrote the memory, without candidates for new walls.
    ///
    /// # Errors
    /// Where the numbers do not fit together or are none.
    pub fn restore(memory: &SavedState) -> Result<Self, InvalidState> {
        if memory.walls.len() != memory.filter.offsets_m.len() {
            return Err(InvalidState("the filter holds another number of walls than are described"));
        }
        let filter = Filter::restore(&memory.filter)?;
        let walls = memory.walls.iter().map(WallLandmark::restore).collect::<Result<Vec<_>, _>>()?;
        let inactive = memory.inactive.iter().map(|inactive| {
            if !(inactive.offset_m.abs() < 1e6 && (0.0..1e6).contains(&inactive.variance)) {
                return Err(InvalidState("a wall lies nowhere"));
            }
            let wall = WallLandmark::restore(&inactive.wall)?;
            Ok(InactiveLandmark { wall, offset_m: inactive.offset_m, variance: inactive.variance })
        });
        let inactive = inactive.collect::<Result<Vec<_>, _>>()?;
        let mut tracker = Self::new(filter.pose(), 0.0, memory.filter.nominal);
        (tracker.filter, tracker.walls, tracker.inactive) = (filter, walls, InactiveLandmarks::with(inactive));
        Ok(tracker)
    }

    /// True where the walls are known and none is changed.
    #[must_use]
    pub fn is_frozen(&self) -> bool {
        self.is_frozen
    }

    /// Takes the walls as they are: from now on the tracker finds the robot among them and changes none.
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

    fn restore(memory: &LandmarkState) -> Result<Self, InvalidState> {
        let side = Side::ALL.into_iter().find(|side| side.index() == memory.side);
        let side = side.ok_or(InvalidState("a wall is seen from no side"))?;
        if !(memory.lo_m.abs() < 1e6 && memory.hi_m.abs() < 1e6) {
            return Err(InvalidState("a wall reaches nowhere"));
        }
        Ok(Self { side, lo_m: memory.lo_m, hi_m: memory.hi_m, hits: memory.hits, last_sweep: 0, first_sweep: None })
    }
}
