//! A plot: curves, dots or a map over two axes with ticks, units and a legend.

use super::canvas::{Canvas, Ink, Pen, Pixel, TEXT_PX};
use crate::map_file::{FREE_PERCENT, OCCUPIED_PERCENT};
use slamd_core::{Point, Raster};

/// A line of the plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: &'static str,
    /// Red, green, blue and opacity.
    pub ink: [u8; 4],
    /// True for a dashed line.
    pub is_dashed: bool,
    /// Its corners, in the units of the axes.
    pub points: Vec<Point>,
}

/// What is drawn, from the bottom: the map, the dots, the curves.
#[derive(Clone, Debug, Default)]
pub struct Plot {
    /// Above everything.
    pub title: String,
    /// The horizontal axis with its unit.
    pub x_label: &'static str,
    /// The vertical axis with its unit.
    pub y_label: &'static str,
    /// A map in the axes' units; then both axes have the same scale.
    pub map: Option<Raster>,
    /// Small dots, their name in the legend first; then both axes have the same scale.
    pub dots: Option<(&'static str, Vec<Point>)>,
    /// Lines, in the order of the legend.
    pub curves: Vec<Curve>,
}

impl Plot {
    /// Draws the plot as a PNG file.
    ///
    /// # Errors
    /// Where the picture is too large for the format.
    pub fn to_png(&self) -> std::io::Result<Vec<u8>> {
        let axes = Axes::new(self);
        let mut canvas = Canvas::new(whole(WIDTH_PX), whole(axes.height_px), PAPER);
        self.draw_grid(&mut canvas, &axes);
        if let Some(raster) = &self.map {
            draw_map(&mut canvas, &axes, raster);
        }
        for &dot in self.dots.iter().flat_map(|(_, dots)| dots) {
            let (x, y) = axes.pixel(dot);
            canvas.set(whole(x), whole(y), DOT);
        }
        for curve in &self.curves {
            canvas.polyline(curve.points.iter().map(|&point| axes.pixel(point)), curve.pen());
        }
        self.draw_words(&mut canvas, &axes);
        canvas.into_png()
    }

    /// Lowest and highest x and y of everything, and a little room round it.
    fn bounds(&self) -> (Point, Point) {
        let cells = self.map.iter().flat_map(known).map(|(corner, _)| corner);
        let dots = self.dots.iter().flat_map(|(_, dots)| dots.iter().copied());
        let curves = self.curves.iter().flat_map(|curve| curve.points.iter().copied());
        let bounds = cells.chain(dots).chain(curves).fold(None, |bounds: Option<(Point, Point)>, p| {
            let (low, high) = bounds.unwrap_or((p, p));
            Some((Point::new(low.x.min(p.x), low.y.min(p.y)), Point::new(high.x.max(p.x), high.y.max(p.y))))
        });
        let (low, high) = bounds.unwrap_or_else(|| (Point::origin(), Point::new(1.0, 1.0)));
        let room = |low: f64, high: f64| (ROOM * (high - low)).max(1e-3);
        let (x, y) = (room(low.x, high.x), room(low.y, high.y));
        (Point::new(low.x - x, low.y - y), Point::new(high.x + x, high.y + y))
    }

    fn draw_grid(&self, canvas: &mut Canvas, axes: &Axes) {
        let (low, high) = (axes.pixel(axes.low), axes.pixel(axes.high));
        canvas.polygon([low, (low.0, high.1), high, (high.0, low.1)], GROUND);
        for x in ticks(axes.low.x, axes.high.x) {
            let at = axes.pixel(Point::new(x.0, axes.low.y));
            canvas.polyline([at, (at.0, high.1)], Pen::solid(GRID, 1.0));
            canvas.text((at.0 - 0.5 * Canvas::text_width_px(&x.1), at.1 + 6.0), &x.1, TEXT);
        }
        for y in ticks(axes.low.y, axes.high.y) {
            let at = axes.pixel(Point::new(axes.low.x, y.0));
            canvas.polyline([at, (high.0, at.1)], Pen::solid(GRID, 1.0));
            canvas.text((at.0 - 8.0 - Canvas::text_width_px(&y.1), at.1 - 0.5 * TEXT_PX), &y.1, TEXT);
        }
    }

    fn draw_words(&self, canvas: &mut Canvas, axes: &Axes) {
        let (low, high) = (axes.pixel(axes.low), axes.pixel(axes.high));
        let frame = [low, (low.0, high.1), high, (high.0, low.1), low];
        canvas.polyline(frame, Pen::solid(TEXT, 1.2));
        canvas.text((LEFT_PX, 8.0), &self.title, TEXT);
        canvas.text((8.0, 38.0), self.y_label, TEXT);
        let middle = 0.5 * (low.0 + high.0 - Canvas::text_width_px(self.x_label));
        canvas.text((middle, low.1 + 30.0), self.x_label, TEXT);
        let mut x = LEFT_PX + Canvas::text_width_px(self.y_label).max(80.0);
        let mut entry = |canvas: &mut Canvas, name: &str, pen: Pen| {
            canvas.polyline([(x, 49.0), (x + 36.0, 49.0)], pen);
            canvas.text((x + 44.0, 38.0), name, TEXT);
            x += 44.0 + Canvas::text_width_px(name) + 26.0;
        };
        if self.map.is_some() {
            entry(canvas, "wall", Pen::solid(WALL, 5.0));
            entry(canvas, "unknown", Pen::solid(GRID, 5.0));
        }
        if let Some((name, _)) = &self.dots {
            entry(canvas, name, Pen { ink: DOT, width_px: 2.0, dash_px: Some((1.0, 5.0)) });
        }
        for curve in &self.curves {
            entry(canvas, curve.name, curve.pen());
        }
    }
}

impl Curve {
    fn pen(&self) -> Pen {
        Pen { ink: self.ink, width_px: 2.0, dash_px: self.is_dashed.then_some((6.0, 5.0)) }
    }
}

/// From the axes' units to pixels.
struct Axes {
    low: Point,
    high: Point,
    height_px: f64,
}

impl Axes {
    fn new(plot: &Plot) -> Self {
        let (low, mut high) = plot.bounds();
        let inner_px = WIDTH_PX - LEFT_PX - RIGHT_PX;
        let mut height_px = TOP_PX + 360.0 + BOTTOM_PX;
        if plot.map.is_some() || plot.dots.is_some() {
            // A tall map gets more width than it needs rather than a picture without end.
            let tallest_px = 760.0;
            let per_unit = (inner_px / (high.x - low.x)).min(tallest_px / (high.y - low.y));
            high.x = low.x + inner_px / per_unit;
            height_px = TOP_PX + per_unit * (high.y - low.y) + BOTTOM_PX;
        }
        Self { low, high, height_px }
    }

    fn pixel(&self, point: Point) -> Pixel {
        let (width, height) = (WIDTH_PX - LEFT_PX - RIGHT_PX, self.height_px - TOP_PX - BOTTOM_PX);
        let x = LEFT_PX + width * (point.x - self.low.x) / (self.high.x - self.low.x);
        (x, self.height_px - BOTTOM_PX - height * (point.y - self.low.y) / (self.high.y - self.low.y))
    }
}

/// Free cells, then the others over them, each at least one pixel.
fn draw_map(canvas: &mut Canvas, axes: &Axes, raster: &Raster) {
    for is_wall in [false, true] {
        for (corner, percent) in known(raster).filter(|(_, percent)| (*percent >= OCCUPIED_PERCENT) == is_wall) {
            let ink = match percent {
                OCCUPIED_PERCENT.. => WALL,
                ..=FREE_PERCENT => FREE,
                _ => continue,
            };
            let (left, bottom) = axes.pixel(corner);
            let (right, top) = axes.pixel(corner + nalgebra::Vector2::new(raster.cell_m, raster.cell_m));
            for row in whole(top)..whole(bottom).max(whole(top) + 1) {
                for column in whole(left)..whole(right).max(whole(left) + 1) {
                    canvas.set(column, row, ink);
                }
            }
        }
    }
}

/// The lower left corner and the occupancy of every known cell.
fn known(raster: &Raster) -> impl Iterator<Item = (Point, i8)> {
    let corner = |index: usize| {
        let place = nalgebra::Vector2::new((index % raster.width) as f64, (index / raster.width) as f64);
        raster.origin + place * raster.cell_m
    };
    let cells = raster.occupancy.iter().enumerate().filter(|(_, percent)| **percent != Raster::UNKNOWN);
    cells.map(move |(index, percent)| (corner(index), *percent))
}

/// Round numbers between two others, with their words.
#[expect(clippy::cast_possible_truncation, reason = "a few ticks")]
fn ticks(low: f64, high: f64) -> impl Iterator<Item = (f64, String)> {
    let about = (high - low) / 9.0;
    let decade = libm::pow(10.0, libm::floor(libm::log10(about)));
    let step = [1.0, 2.0, 5.0, 10.0].map(|part| part * decade).into_iter().find(|step| *step >= about);
    let step = step.unwrap_or(10.0 * decade);
    let digits = if step < 0.099 { 2 } else { usize::from(step < 0.99) };
    let (first, last) = ((low / step).ceil() as i32, (high / step).floor() as i32);
    (first..=last).map(move |k| (f64::from(k) * step, format!("{:.digits$}", f64::from(k) * step)))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the picture")]
fn whole(pixels: f64) -> usize {
    pixels.max(0.0) as usize
}

const WIDTH_PX: f64 = 960.0;
const LEFT_PX: f64 = 100.0;
const RIGHT_PX: f64 = 24.0;
const TOP_PX: f64 = 70.0;
const BOTTOM_PX: f64 = 60.0;
/// Empty room beside what is shown, as a part of it.
const ROOM: f64 = 0.03;

const PAPER: Ink = [255, 255, 255, 255];
const GROUND: Ink = [238, 238, 240, 255];
const GRID: Ink = [212, 212, 216, 255];
const TEXT: Ink = [40, 40, 48, 255];
const WALL: Ink = [24, 24, 32, 255];
const FREE: Ink = [252, 252, 250, 255];
const DOT: Ink = [24, 24, 32, 255];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let words = |low, high| ticks(low, high).map(|tick| tick.1).collect::<Vec<String>>();
        assert_eq!(words(-0.1, 10.3), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(words(0.0, 0.31), ["0.00", "0.05", "0.10", "0.15", "0.20", "0.25", "0.30"]);
        assert_eq!(words(-210.0, 95.0), ["-200", "-150", "-100", "-50", "0", "50"]);
    }

    #[test]
    fn a_map_has_one_scale_and_an_empty_plot_is_a_picture() {
        let raster = Raster { width: 40, height: 10, cell_m: 0.1, origin: Point::origin(), occupancy: vec![0; 400] };
        let axes = Axes::new(&Plot { map: Some(raster), ..Plot::default() });
        let (a, b) = (axes.pixel(Point::origin()), axes.pixel(Point::new(1.0, 1.0)));
        assert!(((b.0 - a.0) - (a.1 - b.1)).abs() < 1e-9);
        assert!(Plot::default().to_png().unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn a_curve_changes_the_picture() {
        let points = vec![Point::origin(), Point::new(1.0, 2.0)];
        let curve = Curve { name: "a", ink: [200, 0, 0, 255], is_dashed: false, points };
        let plot = Plot { curves: vec![curve.clone()], ..Plot::default() };
        let other = Plot { curves: vec![Curve { is_dashed: true, ..curve }], ..Plot::default() };
        assert_ne!(plot.to_png().unwrap(), other.to_png().unwrap());
    }
}
