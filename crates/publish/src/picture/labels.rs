//! Lengths beside the walls, areas in the rooms.

use super::floor::Floor;
use super::surface::{Direction, Ink, Pixel, Surface, TEXT_PX, text_width_px};
use crate::plan::{Plan, Room, Wall};

/// A shorter wall has no label, metres.
const MIN_WALL_M: f64 = 1.0;
/// Between a wall and its length, pixels.
const GAP_PX: f64 = 6.0;
const AREA: Ink = [33, 74, 128, 255];
const LENGTH: Ink = [82, 88, 100, 255];
const GROUND: Ink = [253, 253, 251, 215];

/// A rectangle: upper left and lower right corner.
#[derive(Clone, Copy)]
struct Area {
    low: Pixel,
    high: Pixel,
}

impl Area {
    fn overlaps(&self, other: &Self) -> bool {
        self.low.0 < other.high.0 && other.low.0 < self.high.0 && self.low.1 < other.high.1 && other.low.1 < self.high.1
    }

    fn is_within(&self, (width, height): (usize, usize)) -> bool {
        self.low.0 >= 0.0 && self.low.1 >= 0.0 && self.high.0 <= width as f64 && self.high.1 <= height as f64
    }
}

/// Writes all labels that have room, larger rooms and longer walls first.
pub(super) fn draw(canvas: &mut dyn Surface, floor: &Floor<'_>, plan: &Plan) {
    let mut taken: Vec<Area> = Vec::new();
    for room in &plan.rooms {
        draw_area(canvas, floor, room, &mut taken);
    }
    for wall in plan.walls.iter().filter(|wall| wall.length_m() >= MIN_WALL_M) {
        draw_length(canvas, floor, wall, &mut taken);
    }
}

fn draw_area(canvas: &mut dyn Surface, floor: &Floor<'_>, room: &Room, taken: &mut Vec<Area>) {
    let words = format!("{:.1} m2", room.area_m2);
    let (x, y) = floor.pixel(room.middle);
    let (half, radius_px) = (0.5 * text_width_px(&words) + 5.0, room.radius_m * floor.scale_px_m());
    let area = Area { low: (x - half, y - 0.5 * TEXT_PX - 2.0), high: (x + half, y + 0.5 * TEXT_PX + 2.0) };
    let has_room = half < 1.5 * radius_px && area.is_within(floor.size());
    if has_room && !taken.iter().any(|other| other.overlaps(&area)) {
        let Area { low, high } = area;
        canvas.polygon(&[low, (high.0, low.1), high, (low.0, high.1)], GROUND);
        canvas.text((low.0 + 5.0, low.1 + 2.0), &words, AREA, Direction::Right);
        taken.push(area);
    }
}

fn draw_length(canvas: &mut dyn Surface, floor: &Floor<'_>, wall: &Wall, taken: &mut Vec<Area>) {
    let words = format!("{:.2} m", wall.length_m());
    let (long, high) = (text_width_px(&words), TEXT_PX);
    let length_px = wall.length_m() * floor.scale_px_m();
    if long > length_px {
        return;
    }
    let (width, height) = if wall.is_along_x { (long, high) } else { (high, long) };
    let (x, y) = floor.pixel(wall.middle());
    // In the middle of the wall, and else as near to it as there is a place; outside of the rooms, and else inside.
    let outside = if wall.is_outside_at_the_lower_side { 1.0 } else { -1.0 };
    for (part, side) in PARTS.into_iter().flat_map(|part| [(part, outside), (part, -outside)]) {
        let (along, shift) = (part * (length_px - long), side * (0.5 * high + GAP_PX));
        // Pixels grow downwards, x to the right.
        let (x, y) = if wall.is_along_x { (x + along, y + shift) } else { (x - shift, y + along) };
        let area = Area { low: (x - 0.5 * width, y - 0.5 * height), high: (x + 0.5 * width, y + 0.5 * height) };
        let is_free = area.is_within(floor.size()) && !floor.has_walls(area.low, area.high);
        if is_free && !taken.iter().any(|other| other.overlaps(&area)) {
            let (at, direction) =
                if wall.is_along_x { (area.low, Direction::Right) } else { ((area.low.0, area.high.1), Direction::Up) };
            canvas.text(at, &words, LENGTH, direction);
            taken.push(area);
            return;
        }
    }
}

/// Where on a wall its length may stand: parts of the way from the middle to both ends, halved.
const PARTS: [f64; 7] = [0.0, 0.12, -0.12, 0.25, -0.25, 0.4, -0.4];
