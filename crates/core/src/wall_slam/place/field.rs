//! The map as marks for the end of a return: near a surface, on free floor, or unknown.

use super::params::Params;
use crate::geometry::Point;
use crate::mapping::grid::OccupancyGrid;
use crate::mapping::raster::Raster;

/// Marks by the distance to the next surface, in cells.
const NEAR: [i8; 4] = [8, 7, 4, 2];
/// The mark of free floor away from any surface.
const FREE: i8 = -3;
/// The mark of a perfect fit.
pub(super) const PERFECT: i32 = NEAR[0] as i32;
/// Probability from which on a cell is a surface, and up to which it is free, percent.
const OCCUPIED: i8 = 73;
const CLEAR: i8 = 38;

/// The marks of a map.
#[derive(Clone, Debug)]
pub(super) struct Field {
    width: i32,
    height: i32,
    origin: Point,
    pub(super) cell_m: f64,
    marks: Vec<i8>,
    /// Cells where a robot may stand, one every pitch.
    pub(super) floor: Vec<[i32; 2]>,
}

impl Field {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss, reason = "a raster")]
    pub(super) fn new(grid: &OccupancyGrid, params: &Params) -> Self {
        let Raster { width, height, cell_m, origin, occupancy } = grid.raster();
        // The raster of an empty map has no cells.
        let cell_m = if occupancy.is_empty() { grid.cell_m() } else { cell_m };
        let far = NEAR.len() as u8;
        let mut distances: Vec<u8> = occupancy.iter().map(|&value| if value >= OCCUPIED { 0 } else { far }).collect();
        // City blocks, in two passes.
        for index in 0..distances.len() {
            let left = if index % width > 0 { distances[index - 1] } else { far };
            let below = if index >= width { distances[index - width] } else { far };
            distances[index] = distances[index].min(left.min(below) + 1);
        }
        for index in (0..distances.len()).rev() {
            let right = if index % width + 1 < width { distances[index + 1] } else { far };
            let above = if index + width < distances.len() { distances[index + width] } else { far };
            distances[index] = distances[index].min(right.min(above) + 1);
        }
        let mark = |(&value, &distance): (&i8, &u8)| match NEAR.get(usize::from(distance)) {
            Some(&mark) => mark,
            None if (0..=CLEAR).contains(&value) => FREE,
            None => 0,
        };
        let marks = occupancy.iter().zip(&distances).map(mark).collect();
        let pitch = (params.search.pitch_m / cell_m).round().max(1.0) as usize;
        let is_floor = |index: &usize| (0..=CLEAR).contains(&occupancy[*index]) && distances[*index] > 1;
        let indices =
            (0..height).step_by(pitch).flat_map(|row| (0..width).step_by(pitch).map(move |x| row * width + x));
        let floor = indices.filter(is_floor).map(|index| [(index % width) as i32, (index / width) as i32]).collect();
        Self { width: width as i32, height: height as i32, origin, cell_m, marks, floor }
    }

    /// A point in cells.
    pub(super) fn cells(&self, point: Point) -> [f64; 2] {
        [(point.x - self.origin.x) / self.cell_m, (point.y - self.origin.y) / self.cell_m]
    }

    /// The middle of a cell.
    pub(super) fn middle(&self, cell: [i32; 2]) -> Point {
        let [x, y] = cell.map(|index| (f64::from(index) + 0.5) * self.cell_m);
        Point::new(self.origin.x + x, self.origin.y + y)
    }

    /// The mark of a cell; 0 outside the map.
    #[expect(clippy::cast_sign_loss, reason = "within the field")]
    pub(super) fn mark(&self, x: i32, y: i32) -> i32 {
        if x < 0 || y < 0 || x >= self.width || y >= self.height {
            return 0;
        }
        i32::from(self.marks[y as usize * self.width as usize + x as usize])
    }
}
