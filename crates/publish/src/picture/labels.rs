//! Lengths beside the walls, areas in the rooms.

use super::floor::Floor;
use super::surface::{Direction, Ink, Pixel, Surface, TEXT_PX, text_width_px};
use crate::plan::{Plan, Room, Spot, Wall};

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

/// What is in the picture beside the labels.
pub(super) struct Drawn {
    /// Points of the path, a few pixels apart.
    path: Vec<Pixel>,
    taken: Vec<Area>,
}

impl Drawn {
    /// The corners of the path, and circles in which nothing is written, each with its radius.
    pub(super) fn new<'a>(paths: impl Iterator<Item = &'a [Pixel]>, circles: &[(Pixel, f64)]) -> Self {
        let between = |ends: &[Pixel]| {
            let [from, to] = [ends.first(), ends.last()].map(|end| end.copied().unwrap_or_default());
            let (dx, dy) = (to.0 - from.0, to.1 - from.1);
            let parts = (libm::hypot(dx, dy) / PATH_STEP_PX).ceil().clamp(1.0, 1_000.0);
            (0..1_000u32)
                .map(f64::from)
                .take_while(move |part| *part <= parts)
                .map(move |part| (from.0 + dx * part / parts, from.1 + dy * part / parts))
        };
        let path = paths.flat_map(|path| path.windows(2).flat_map(between)).collect();
        let around = |&((x, y), radius_px): &(Pixel, f64)| Area {
            low: (x - radius_px, y - radius_px),
            high: (x + radius_px, y + radius_px),
        };
        Self { path, taken: circles.iter().map(around).collect() }
    }

    fn is_taken(&self, area: &Area) -> bool {
        self.taken.iter().any(|other| other.overlaps(area))
    }

    fn is_crossed(&self, area: &Area) -> bool {
        let (low, high) = (area.low, area.high);
        let within = |(x, y): Pixel| {
            (low.0 - PATH_STEP_PX..high.0 + PATH_STEP_PX).contains(&x)
                && (low.1 - PATH_STEP_PX..high.1 + PATH_STEP_PX).contains(&y)
        };
        self.path.iter().any(|point| within(*point))
    }
}

/// Writes all labels that have room, larger rooms and longer walls first; not over the path where there is another place.
pub(super) fn draw(canvas: &mut dyn Surface, floor: &Floor<'_>, plan: &Plan, drawn: &mut Drawn) {
    for room in &plan.rooms {
        draw_area(canvas, floor, room, drawn);
    }
    for wall in plan.walls.iter().filter(|wall| wall.length_m() >= MIN_WALL_M) {
        draw_length(canvas, floor, wall, drawn);
    }
}

/// A path is that wide with its halo, and its points are as far apart, pixels.
const PATH_STEP_PX: f64 = 4.0;

fn draw_area(canvas: &mut dyn Surface, floor: &Floor<'_>, room: &Room, drawn: &mut Drawn) {
    let words = format!("{:.1} m2", room.area_m2);
    let half = 0.5 * text_width_px(&words) + 5.0;
    let around = |spot: &Spot| {
        let (x, y) = floor.pixel(spot.at);
        Area { low: (x - half, y - 0.5 * TEXT_PX - 2.0), high: (x + half, y + 0.5 * TEXT_PX + 2.0) }
    };
    let has_room = |spot: &&Spot| half < 1.5 * spot.radius_m * floor.scale_px_m();
    let mut areas: Vec<Area> = room.spots.iter().filter(has_room).map(around).collect();
    areas.retain(|area| area.is_within(floor.size()) && !drawn.is_taken(area));
    let is_clear = |area: &&Area| !drawn.is_crossed(area) && !floor.has_walls(area.low, area.high);
    let Some(area) = areas.iter().find(is_clear).or_else(|| areas.first()).copied() else { return };
    let Area { low, high } = area;
    canvas.polygon(&[low, (high.0, low.1), high, (low.0, high.1)], GROUND);
    canvas.text((low.0 + 5.0, low.1 + 2.0), &words, AREA, Direction::Right);
    drawn.taken.push(area);
}

fn draw_length(canvas: &mut dyn Surface, floor: &Floor<'_>, wall: &Wall, drawn: &mut Drawn) {
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
    let places = PARTS.into_iter().flat_map(|part| [(part, outside), (part, -outside)]);
    let mut areas = places.map(|(part, side)| {
        let (along, shift) = (part * (length_px - long), side * (0.5 * high + GAP_PX));
        // Pixels grow downwards, x to the right.
        let (x, y) = if wall.is_along_x { (x + along, y + shift) } else { (x - shift, y + along) };
        Area { low: (x - 0.5 * width, y - 0.5 * height), high: (x + 0.5 * width, y + 0.5 * height) }
    });
    let is_free = |area: &Area| {
        area.is_within(floor.size())
            && !floor.has_walls(area.low, area.high)
            && !drawn.is_taken(area)
            && !drawn.is_crossed(area)
    };
    let Some(area) = areas.find(is_free) else { return };
    let (at, direction) =
        if wall.is_along_x { (area.low, Direction::Right) } else { ((area.low.0, area.high.1), Direction::Up) };
    canvas.text(at, &words, LENGTH, direction);
    drawn.taken.push(area);
}

/// Where on a wall its length may stand: parts of the way from the middle to both ends, halved.
const PARTS: [f64; 7] = [0.0, 0.12, -0.12, 0.25, -0.25, 0.4, -0.4];
