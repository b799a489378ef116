//! The map as marks for the end of a return: near a surface, on free floor, or unknown.

use super::params::Params;
use crate::geometry::Point;
use crate::mapping::grid::OccupancyGrid;
use crate::mapping::raster::Raster;

/// Marks by the distance to the next surface, in cells.
const NEAR: [i8; 4] = [8, 7, 4, 2];
/// The mark of free floor away from any surface.
pub(super) const FREE: i8 = -3;
/// The mark of a perfect fit.
pub(super) const PERFECT: i32 = NEAR[0] as i32;
/// Probability from which on a cell is a surface, and up to which it is free, percent.
const OCCUPIED: i8 = 73;
const CLEAR: i8 = 38;

/// Beams that miss a wall clear a little behind it: free floor nearer than this to what is not free may be a wall's, cells.
const DEEP: u8 = 6;

/// The marks of a map.
#[derive(Clone, Debug)]
pub(in crate::wall_slam) struct Field {
    width: i32,
    height: i32,
    origin: Point,
    /// The frame's cell in which the field begins.
    first: [i32; 2],
    pub(super) cell_m: f64,
    marks: Vec<i8>,
    /// Free floor at least [`DEEP`] cells from all that is not.
    deep: Vec<bool>,
    /// Cells where a robot may stand, one every pitch.
    pub(super) floor: Vec<[i32; 2]>,
}

impl Field {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss, reason = "a raster")]
    pub(in crate::wall_slam) fn new(grid: &OccupancyGrid, params: &Params) -> Self {
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
        let deep = deep(&occupancy, width);
        let pitch = (params.search.pitch_m / cell_m).round().max(1.0) as usize;
        let is_floor = |index: &usize| (0..=CLEAR).contains(&occupancy[*index]) && distances[*index] > 1;
        let indices =
            (0..height).step_by(pitch).flat_map(|row| (0..width).step_by(pitch).map(move |x| row * width + x));
        let floor = indices.filter(is_floor).map(|index| [(index % width) as i32, (index / width) as i32]).collect();
        let first = [origin.x, origin.y].map(|metres| libm::round(metres / cell_m) as i32);
        Self { width: width as i32, height: height as i32, origin, first, cell_m, marks, deep, floor }
    }

    /// True where a robot may stand.
    #[expect(clippy::cast_possible_truncation, reason = "a cell")]
    pub(in crate::wall_slam) fn is_floor(&self, point: Point) -> bool {
        let [x, y] = self.cells(point).map(|cell| libm::floor(cell) as i32);
        self.mark(x, y) == i32::from(FREE)
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

    /// The first and last of the frame's cells.
    pub(super) fn bounds(&self) -> [[i32; 2]; 2] {
        let [x, y] = self.first;
        [[x, y], [x + self.width - 1, y + self.height - 1]]
    }

    /// The frame's cells that are surely free.
    pub(super) fn deep_cells(&self) -> Vec<[i32; 2]> {
        self.cells_where(|index| self.deep[index])
    }

    /// The frame's cells with that mark.
    pub(super) fn cells_marked(&self, mark: i32) -> Vec<[i32; 2]> {
        self.cells_where(|index| i32::from(self.marks[index]) == mark)
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss, reason = "a raster")]
    fn cells_where(&self, is_so: impl Fn(usize) -> bool) -> Vec<[i32; 2]> {
        let ([x, y], width) = (self.first, self.width.max(1) as usize);
        let indices = (0..self.marks.len()).filter(|index| is_so(*index));
        indices.map(|index| [x + (index % width) as i32, y + (index / width) as i32]).collect()
    }

    /// True if one of the frame's cells is surely free.
    #[expect(clippy::cast_sign_loss, reason = "within the field")]
    pub(super) fn is_deep(&self, cell: [i32; 2]) -> bool {
        let (x, y) = (cell[0] - self.first[0], cell[1] - self.first[1]);
        let is_inside = x >= 0 && y >= 0 && x < self.width && y < self.height;
        is_inside && self.deep[y as usize * self.width as usize + x as usize]
    }

    /// The mark of one of the frame's cells.
    pub(super) fn mark_of(&self, cell: [i32; 2]) -> i32 {
        let [x, y] = self.first;
        self.mark(cell[0] - x, cell[1] - y)
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

/// Whether each cell of a raster is free and at least [`DEEP`] steps of a king from all that is not.
fn deep(occupancy: &[i8], width: usize) -> Vec<bool> {
    let mut depths: Vec<u8> =
        occupancy.iter().map(|value| if (0..=CLEAR).contains(value) { DEEP } else { 0 }).collect();
    let height = occupancy.len().checked_div(width).unwrap_or(0);
    let mut relax = |x: usize, y: usize, neighbours: [Option<usize>; 4]| {
        let nearest = neighbours.map(|index| index.map_or(0, |index| depths[index])).into_iter().min().unwrap_or(0);
        depths[y * width + x] = depths[y * width + x].min(nearest + 1);
    };
    // Outside nothing is known to be free.
    let at = |x: Option<usize>, y: Option<usize>| Some(y? * width + x.filter(|x| *x < width)?);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let (left, right, below) = (x.checked_sub(1), Some(x + 1), y.checked_sub(1));
        relax(x, y, [at(left, Some(y)), at(left, below), at(Some(x), below), at(right, below)]);
    }
    for (y, x) in (0..height).rev().flat_map(|y| (0..width).rev().map(move |x| (y, x))) {
        let (left, right, above) = (x.checked_sub(1), Some(x + 1), Some(y + 1).filter(|y| *y < height));
        relax(x, y, [at(right, Some(y)), at(right, above), at(Some(x), above), at(left, above)]);
    }
    depths.into_iter().map(|depth| depth >= DEEP).collect()
}
