//! Floor plans: rooms, doors and blocks as axis-aligned rectangles. The space between rooms is wall.

use super::world::Segment;
use slamd_core::{Point, Pose2};

/// An axis-aligned rectangle, metres: left, lower, right and upper edge.
pub type Rectangle = [f64; 4];

/// A building: free rectangles (rooms, doors) cut out of a solid, and solid blocks inside them.
#[derive(Clone, Copy, Debug)]
pub struct FloorPlan<'a> {
    /// Rooms and door openings; they may overlap.
    pub free: &'a [Rectangle],
    /// Furniture and pillars.
    pub blocks: &'a [Rectangle],
}

impl FloorPlan<'_> {
    /// Every face between free space and solid, in one piece: a wall between two rooms has two faces.
    #[must_use]
    pub fn faces(&self) -> Vec<Segment> {
        let xs = self.edges(0);
        let ys = self.edges(1);
        // Cell (i, j) lies left of and below the edges xs[i] and ys[j]; cells outside all edges are solid.
        let free = |i: usize, j: usize| match (middle(&xs, i), middle(&ys, j)) {
            (Some(x), Some(y)) => self.is_free(x, y),
            _ => false,
        };
        let mut faces = Vec::new();
        for (i, &x) in xs.iter().enumerate() {
            let face = |j: usize| (free(i, j), free(i + 1, j));
            runs(&ys, face, |from, to| faces.push(Segment { from: Point::new(x, from), to: Point::new(x, to) }));
        }
        for (j, &y) in ys.iter().enumerate() {
            let face = |i: usize| (free(i, j), free(i, j + 1));
            runs(&xs, face, |from, to| faces.push(Segment { from: Point::new(from, y), to: Point::new(to, y) }));
        }
        faces
    }

    fn is_free(&self, x: f64, y: f64) -> bool {
        let holds = |r: &Rectangle| r[0] < x && x < r[2] && r[1] < y && y < r[3];
        self.free.iter().any(holds) && !self.blocks.iter().any(holds)
    }

    /// The edge coordinates along one axis (0: x, 1: y), ascending, without duplicates.
    fn edges(&self, axis: usize) -> Vec<f64> {
        let mut edges: Vec<f64> = self.free.iter().chain(self.blocks).flat_map(|r| [r[axis], r[axis + 2]]).collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        edges
    }
}

/// The middle between `edges[i - 1]` and `edges[i]`; `None` before the first and after the last edge.
fn middle(edges: &[f64], i: usize) -> Option<f64> {
    Some(0.5 * (edges.get(i.checked_sub(1)?)? + edges.get(i)?))
}

/// Calls `emit(from, to)` for each maximal run of cells between `edges` whose two sides differ in
/// the same way.
fn runs(edges: &[f64], sides: impl Fn(usize) -> (bool, bool), mut emit: impl FnMut(f64, f64)) {
    let mut begun: Option<(f64, (bool, bool))> = None;
    for (cell, &edge) in edges.iter().enumerate() {
        // `cell` ends at `edge`; the cell after the last edge is solid on both sides.
        let next = sides(cell + 1);
        if let Some((from, side)) = begun
            && side != next
        {
            emit(from, edge);
            begun = None;
        }
        if begun.is_none() && next.0 != next.1 {
            begun = Some((edge, next));
        }
    }
}

/// The four faces of a box of `size_m` (along its own axes) around `centre`, turned by `angle_rad`.
#[must_use]
pub fn box_faces(centre: Point, size_m: [f64; 2], angle_rad: f64) -> [Segment; 4] {
    let world_from_box = Pose2::new(centre.x, centre.y, angle_rad);
    let corner = |x: f64, y: f64| world_from_box.transform(Point::new(0.5 * x * size_m[0], 0.5 * y * size_m[1]));
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    std::array::from_fn(|i| Segment { from: corners[i], to: corners[(i + 1) % 4] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_has_four_faces() {
        let faces = FloorPlan { free: &[[0.0, 0.0, 4.0, 3.0]], blocks: &[] }.faces();
        assert_eq!(faces.len(), 4);
        let length: f64 = faces.iter().map(|face| (face.to - face.from).norm()).sum();
        assert!((length - 14.0).abs() < 1e-12);
    }

    #[test]
    fn a_wall_with_a_door_has_two_faces_and_two_jambs() {
        let rooms = [[0.0, 0.0, 2.0, 2.0], [2.1, 0.0, 4.0, 2.0], [2.0, 0.5, 2.1, 1.4]];
        let faces = FloorPlan { free: &rooms, blocks: &[] }.faces();
        let jambs = faces.iter().filter(|face| ((face.to - face.from).norm() - 0.1).abs() < 1e-9).count();
        let pieces = faces
            .iter()
            .filter(|face| (face.from.x - face.to.x).abs() < 1e-9 && face.from.x > 1.9 && face.from.x < 2.2);
        assert_eq!((jambs, pieces.count(), faces.len()), (2, 4, 4 + 4 + 2 + 2));
    }

    #[test]
    fn a_block_in_a_room_adds_four_faces() {
        let plan = FloorPlan { free: &[[0.0, 0.0, 4.0, 3.0]], blocks: &[[1.0, 1.0, 2.0, 2.0]] };
        assert_eq!(plan.faces().len(), 8);
    }

    #[test]
    fn a_turned_box_keeps_its_size() {
        let faces = box_faces(Point::new(1.0, 2.0), [0.8, 0.4], 0.5);
        let length = |i: usize| (faces[i].to - faces[i].from).norm();
        assert!((length(0) - 0.8).abs() < 1e-12 && (length(1) - 0.4).abs() < 1e-12);
        assert!((faces[2].to - faces[3].from).norm() < 1e-12 && (faces[3].to - faces[0].from).norm() < 1e-12);
    }
}
