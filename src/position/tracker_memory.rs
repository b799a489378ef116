//! What a tracker remembers: its walls, those in the filter and those out of sight.

use super::beam_model::Side;
use super::filter::Filter;
use super::parking::{Parked, Parking};
use super::tracker::{Tracker, Wall};
use crate::memory::{Impossible, Memory, ParkedMemory, WallMemory};

impl Tracker {
    /// The walls as plain numbers: those in the filter, in its order, and those out of its sight.
    #[must_use]
    pub fn wall_memory(&self) -> (Vec<WallMemory>, Vec<ParkedMemory>) {
        let parked = self.parking.iter().map(|parked| ParkedMemory {
            wall: parked.wall.memory(),
            offset_m: parked.offset_m,
            variance: parked.variance,
        });
        (self.walls().iter().map(Wall::memory).collect(), parked.collect())
    }

    /// The tracker that wrote the memory, without candidates for new walls.
    ///
    /// # Errors
    /// Where the numbers do not fit together or are none.
    pub fn restore(memory: &Memory) -> Result<Self, Impossible> {
        if memory.walls.len() != memory.filter.offsets_m.len() {
            return Err(Impossible("the filter holds another number of walls than are described"));
        }
        let filter = Filter::restore(&memory.filter)?;
        let walls = memory.walls.iter().map(Wall::restore).collect::<Result<Vec<_>, _>>()?;
        let parked = memory.parked.iter().map(|parked| {
            if !(parked.offset_m.abs() < 1e6 && (0.0..1e6).contains(&parked.variance)) {
                return Err(Impossible("a wall lies nowhere"));
            }
            let wall = Wall::restore(&parked.wall)?;
            Ok(Parked { wall, offset_m: parked.offset_m, variance: parked.variance })
        });
        let parked = parked.collect::<Result<Vec<_>, _>>()?;
        let mut tracker = Self::new(filter.pose(), 0.0, memory.filter.nominal);
        (tracker.filter, tracker.walls, tracker.parking) = (filter, walls, Parking::with(parked));
        Ok(tracker)
    }

    /// True where the walls are known and none is changed.
    #[must_use]
    pub fn is_fixed(&self) -> bool {
        self.is_fixed
    }

    /// Takes the walls as they are: from now on the tracker finds the robot among them and changes none.
    pub fn fix_walls(&mut self) {
        self.is_fixed = true;
        self.filter.fix_walls();
        self.parking.fix();
    }
}

impl Wall {
    fn memory(&self) -> WallMemory {
        WallMemory { side: self.side.index(), lo_m: self.lo_m, hi_m: self.hi_m, hits: self.hits }
    }

    fn restore(memory: &WallMemory) -> Result<Self, Impossible> {
        let side = Side::ALL.into_iter().find(|side| side.index() == memory.side);
        let side = side.ok_or(Impossible("a wall is seen from no side"))?;
        if !(memory.lo_m.abs() < 1e6 && memory.hi_m.abs() < 1e6) {
            return Err(Impossible("a wall reaches nowhere"));
        }
        Ok(Self { side, lo_m: memory.lo_m, hi_m: memory.hi_m, hits: memory.hits, last_sweep: 0, first_sweep: None })
    }
}
