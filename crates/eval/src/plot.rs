//! Plots of the benches and of the paper's experiment, drawn by `plotters`: curves, dots and maps over labelled axes.
//!
//! The font comes from a crate, so that a picture is the same on every machine and needs no C library.

use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontFamily, FontStyle, register_font};
use slamd_core::{Point, Raster};
use slamd_publish::{FREE_PERCENT, OCCUPIED_PERCENT};
use std::io;

/// A curve of the plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: &'static str,
    /// Red, green and blue.
    pub rgb: [u8; 3],
    /// True for a dashed curve.
    pub is_dashed: bool,
    /// Its corners, in the units of the axes.
    pub points: Vec<Point>,
}

/// One pair of axes. Drawn from the bottom: the map, the dots, the curves.
#[derive(Clone, Debug, Default)]
pub struct Plot {
    /// Above the axes.
    pub title: String,
    /// The horizontal axis with its unit.
    pub x_label: &'static str,
    /// The vertical axis with its unit.
    pub y_label: &'static str,
    /// A map in the axes' units; then both axes have the same scale.
    pub map: Option<Raster>,
    /// Small dots, their name in the legend first; then both axes have the same scale.
    pub dots: Option<(&'static str, Vec<Point>)>,
    /// Curves, in the order of the legend.
    pub curves: Vec<Curve>,
}

/// Draws plots, one below the other, as a PNG file. Each has its own axes: quantities of two units are two plots.
///
/// # Errors
/// When the picture is too large for the format.
pub fn to_png(plots: &[Plot]) -> io::Result<Vec<u8>> {
    let axes: Vec<Axes> = plots.iter().map(Axes::new).collect();
    let heights_px: Vec<u32> = axes.iter().map(Axes::height_px).collect();
    let height_px = heights_px.iter().sum::<u32>().max(1);
    let mut rgb = vec![0; (WIDTH_PX * height_px * 3) as usize];
    draw(&mut rgb, height_px, plots, &axes, &heights_px).map_err(io::Error::other)?;
    encode(&rgb, height_px)
}

type DrawError = Box<dyn std::error::Error + Send + Sync>;
type Area<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;
type Chart<'a, 'b> = ChartContext<'a, BitMapBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

fn draw(rgb: &mut [u8], height_px: u32, plots: &[Plot], axes: &[Axes], heights_px: &[u32]) -> Result<(), DrawError> {
    register_font(FONT.as_str(), FontStyle::Normal, dejavu::sans_mono::regular())
        .map_err(|_| "the font of the plots is broken")?;
    let mut rest = BitMapBackend::with_buffer(rgb, (WIDTH_PX, height_px)).into_drawing_area();
    rest.fill(&WHITE)?;
    for ((plot, axes), height_px) in plots.iter().zip(axes).zip(heights_px) {
        let (area, below) = rest.split_vertically(*height_px);
        plot.draw(&area, axes)?;
        rest = below;
    }
    rest.present()?;
    Ok(())
}

fn encode(rgb: &[u8], height_px: u32) -> io::Result<Vec<u8>> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, WIDTH_PX, height_px);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header().and_then(|mut writer| writer.write_image_data(rgb))?;
    Ok(file)
}

impl Plot {
    fn draw(&self, area: &Area<'_>, axes: &Axes) -> Result<(), DrawError> {
        let title = (FONT, TITLE_PX).into_font().color(&TEXT).pos(Pos::new(HPos::Center, VPos::Top));
        let middle_px = i32::try_from((LEFT_PX + WIDTH_PX - RIGHT_PX) / 2)?;
        area.draw(&Text::new(self.title.as_str(), (middle_px, 16), title))?;
        let mut chart = ChartBuilder::on(area)
            .margin_top(TOP_PX)
            .margin_right(RIGHT_PX)
            .x_label_area_size(BOTTOM_PX)
            .margin_left(LEFT_MARGIN_PX)
            .y_label_area_size(LEFT_PX - LEFT_MARGIN_PX)
            .build_cartesian_2d(axes.low.x..axes.high.x, axes.low.y..axes.high.y)?;
        chart.plotting_area().fill(if self.map.is_some() { &UNKNOWN } else { &WHITE })?;
        chart
            .configure_mesh()
            .x_desc(self.x_label)
            .y_desc(self.y_label)
            .x_labels(10)
            .y_labels(8)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .axis_style(TEXT)
            .label_style((FONT, LABEL_PX).into_font().color(&TEXT))
            .axis_desc_style((FONT, WORDS_PX).into_font().color(&TEXT))
            .draw()?;
        self.draw_map(&mut chart)?;
        self.draw_dots(&mut chart)?;
        for curve in &self.curves {
            curve.draw(&mut chart)?;
        }
        chart
            .configure_series_labels()
            .position(self.emptiest_corner(axes))
            .background_style(WHITE.mix(0.85))
            .border_style(GRID)
            .legend_area_size(SWATCH_PX + 10)
            .label_font((FONT, LABEL_PX).into_font().color(&TEXT))
            .draw()?;
        Ok(())
    }

    /// Free cells first, occupied ones over them: neighbours share their edge pixels, and walls must win.
    fn draw_map(&self, chart: &mut Chart<'_, '_>) -> Result<(), DrawError> {
        let Some(raster) = &self.map else { return Ok(()) };
        let cell = nalgebra::Vector2::repeat(raster.cell_m);
        let boxes = |is_wanted: fn(i8) -> bool, ink: RGBColor| {
            known(raster).filter(move |(_, percent)| is_wanted(*percent)).map(move |(low, _)| {
                let high = low + cell;
                Rectangle::new([(low.x, low.y), (high.x, high.y)], ink.filled())
            })
        };
        let swatch = |ink: RGBColor| {
            move |(x, y)| Rectangle::new([(x, y - 5), (x + SWATCH_PX, y + 5)], ShapeStyle::from(ink).filled())
        };
        chart.draw_series(boxes(|percent| percent <= FREE_PERCENT, FREE))?;
        chart.draw_series(boxes(|percent| percent >= OCCUPIED_PERCENT, WALL))?.label("wall").legend(swatch(WALL));
        // The background is the unknown; the legend gets its entry from a series without elements.
        let nothing = std::iter::empty::<Rectangle<(f64, f64)>>();
        chart.draw_series(nothing)?.label("unknown").legend(swatch(UNKNOWN));
        Ok(())
    }

    fn draw_dots(&self, chart: &mut Chart<'_, '_>) -> Result<(), DrawError> {
        let Some((name, dots)) = &self.dots else { return Ok(()) };
        let pixels = dots.iter().map(|dot| Pixel::new((dot.x, dot.y), WALL));
        let sample = |(x, y)| Circle::new((x + SWATCH_PX / 2, y), 2, ShapeStyle::from(WALL).filled());
        chart.draw_series(pixels)?.label(*name).legend(sample);
        Ok(())
    }

    /// All points that are drawn, the lower left corners of known cells among them.
    fn points(&self) -> impl Iterator<Item = Point> {
        let cells = self.map.iter().flat_map(known).map(|(corner, _)| corner);
        let dots = self.dots.iter().flat_map(|(_, dots)| dots.iter().copied());
        cells.chain(dots).chain(self.curves.iter().flat_map(|curve| curve.points.iter().copied()))
    }

    /// Where the legend hides least.
    fn emptiest_corner(&self, axes: &Axes) -> SeriesLabelPosition {
        let size = axes.high - axes.low;
        let hidden = |is_right: bool, is_upper: bool| {
            let part = |value: f64, is_far: bool| if is_far { 1.0 - value } else { value };
            let is_inside = |point: &Point| {
                let at = *point - axes.low;
                part(at.x / size.x, is_right) < LEGEND_PART[0] && part(at.y / size.y, is_upper) < LEGEND_PART[1]
            };
            self.points().filter(is_inside).count()
        };
        let corners = [
            (SeriesLabelPosition::UpperRight, hidden(true, true)),
            (SeriesLabelPosition::UpperLeft, hidden(false, true)),
            (SeriesLabelPosition::LowerRight, hidden(true, false)),
            (SeriesLabelPosition::LowerLeft, hidden(false, false)),
        ];
        let best = corners.into_iter().min_by_key(|(_, hidden)| *hidden);
        best.map_or(SeriesLabelPosition::UpperRight, |(corner, _)| corner)
    }
}

impl Curve {
    fn draw(&self, chart: &mut Chart<'_, '_>) -> Result<(), DrawError> {
        let [red, green, blue] = self.rgb;
        let style = RGBColor(red, green, blue).stroke_width(2);
        let points: Vec<(f64, f64)> = self.points.iter().map(|point| (point.x, point.y)).collect();
        if self.is_dashed {
            let dashes = DashedLineSeries::new(points, DASH_PX, GAP_PX, style);
            let sample = move |(x, y)| DashedPathElement::new([(x, y), (x + SWATCH_PX, y)], DASH_PX, GAP_PX, style);
            chart.draw_series(dashes)?.label(self.name).legend(sample);
        } else {
            let sample = move |(x, y)| PathElement::new([(x, y), (x + SWATCH_PX, y)], style);
            chart.draw_series(LineSeries::new(points, style))?.label(self.name).legend(sample);
        }
        Ok(())
    }
}

/// The part of the plane that is shown, and the height of what shows it.
struct Axes {
    low: Point,
    high: Point,
    inner_height_px: f64,
}

impl Axes {
    fn new(plot: &Plot) -> Self {
        let bounds = plot.points().fold(None, |bounds: Option<(Point, Point)>, p| {
            let (low, high) = bounds.unwrap_or((p, p));
            Some((Point::new(low.x.min(p.x), low.y.min(p.y)), Point::new(high.x.max(p.x), high.y.max(p.y))))
        });
        let (low, high) = bounds.unwrap_or_else(|| (Point::origin(), Point::new(1.0, 1.0)));
        let room = (ROOM * (high - low)).map(|room| room.max(1e-3));
        let (low, mut high) = (low - room, high + room);
        let mut inner_height_px = CURVES_PX;
        if plot.map.is_some() || plot.dots.is_some() {
            // A tall map leaves room at its right rather than making a picture without end.
            let inner_width_px = f64::from(WIDTH_PX - LEFT_PX - RIGHT_PX);
            let px_per_unit = (inner_width_px / (high.x - low.x)).min(MAX_MAP_PX / (high.y - low.y));
            high.x = low.x + inner_width_px / px_per_unit;
            inner_height_px = px_per_unit * (high.y - low.y);
        }
        Self { low, high, inner_height_px }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most MAX_MAP_PX, positive")]
    fn height_px(&self) -> u32 {
        TOP_PX + libm::round(self.inner_height_px) as u32 + BOTTOM_PX
    }
}

/// The lower left corner and the occupancy of every known cell.
fn known(raster: &Raster) -> impl Iterator<Item = (Point, i8)> {
    let corner = |index: usize| {
        let cell = nalgebra::Vector2::new((index % raster.width) as f64, (index / raster.width) as f64);
        raster.origin + cell * raster.cell_m
    };
    let cells = raster.occupancy.iter().enumerate().filter(|(_, percent)| **percent != Raster::UNKNOWN);
    cells.map(move |(index, percent)| (corner(index), *percent))
}

/// Any name: the font is registered under it.
const FONT: FontFamily<'static> = FontFamily::Monospace;

const WIDTH_PX: u32 = 960;
/// Left of the axis, the margin included.
const LEFT_PX: u32 = 94;
const LEFT_MARGIN_PX: u32 = 14;
const RIGHT_PX: u32 = 24;
const TOP_PX: u32 = 48;
const BOTTOM_PX: u32 = 60;
/// Height of a plot of curves alone.
const CURVES_PX: f64 = 360.0;
/// Greatest height of a map.
const MAX_MAP_PX: f64 = 760.0;
/// Empty room beside what is shown, as a part of it.
const ROOM: f64 = 0.03;
/// Width and height of the legend at most, as parts of the plot.
const LEGEND_PART: [f64; 2] = [0.3, 0.25];

const TITLE_PX: u32 = 20;
const WORDS_PX: u32 = 17;
const LABEL_PX: u32 = 16;
const SWATCH_PX: i32 = 28;
const DASH_PX: u32 = 6;
const GAP_PX: u32 = 5;

const UNKNOWN: RGBColor = RGBColor(225, 225, 229);
const GRID: RGBColor = RGBColor(212, 212, 216);
const TEXT: RGBColor = RGBColor(40, 40, 48);
const WALL: RGBColor = RGBColor(24, 24, 32);
const FREE: RGBColor = RGBColor(252, 252, 250);

#[cfg(test)]
mod tests {
    use super::*;

    fn raster(width: usize, height: usize) -> Raster {
        Raster { width, height, cell_m: 0.1, origin: Point::origin(), occupancy: vec![0; width * height] }
    }

    fn pixels(plots: &[Plot]) -> (u32, Vec<u8>) {
        let file = to_png(plots).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(file)).read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let height_px = reader.next_frame(&mut rgb).unwrap().height;
        (height_px, rgb)
    }

    fn count(rgb: &[u8], ink: [u8; 3]) -> usize {
        rgb.chunks_exact(3).filter(|pixel| *pixel == ink).count()
    }

    #[test]
    fn a_map_has_one_scale_and_does_not_grow_without_end() {
        for (width, height) in [(40, 10), (10, 40), (7, 7)] {
            let axes = Axes::new(&Plot { map: Some(raster(width, height)), ..Plot::default() });
            let size = axes.high - axes.low;
            let across = f64::from(WIDTH_PX - LEFT_PX - RIGHT_PX) / size.x;
            assert!((across - axes.inner_height_px / size.y).abs() < 1e-9 && axes.inner_height_px <= MAX_MAP_PX + 1e-9);
        }
    }

    #[test]
    fn an_empty_plot_is_a_picture_with_a_frame() {
        let (height_px, rgb) = pixels(&[Plot::default()]);
        assert_eq!(height_px, TOP_PX + 360 + BOTTOM_PX);
        assert!(count(&rgb, [TEXT.0, TEXT.1, TEXT.2]) > 1000, "two axes");
    }

    #[test]
    fn every_mark_has_its_colour() {
        let mut map = raster(20, 20);
        map.occupancy[..20].fill(100);
        map.occupancy[380..].fill(Raster::UNKNOWN);
        let points = vec![Point::new(0.1, 0.2), Point::new(1.5, 1.4)];
        let curve = Curve { name: "a", rgb: [200, 0, 0], is_dashed: false, points };
        let dashed = Curve { rgb: [0, 200, 0], is_dashed: true, ..curve.clone() };
        let one = |curve: Curve| pixels(&[Plot { map: Some(map.clone()), curves: vec![curve], ..Plot::default() }]).1;
        let (solid, dashes) = (one(curve), one(dashed));
        assert!(count(&solid, [200, 0, 0]) > count(&dashes, [0, 200, 0]) && count(&dashes, [0, 200, 0]) > 200);
        for ink in [UNKNOWN, WALL, FREE] {
            assert!(count(&solid, [ink.0, ink.1, ink.2]) > 500, "{ink:?}");
        }
    }

    #[test]
    fn plots_stand_one_below_the_other() {
        let plot = |points| Plot {
            curves: vec![Curve { name: "a", rgb: [200, 0, 0], is_dashed: false, points }],
            ..Plot::default()
        };
        let a = plot(vec![Point::origin(), Point::new(1.0, 2.0)]);
        let b = plot(vec![Point::origin(), Point::new(1.0, -2000.0)]);
        let (height_px, both) = pixels(&[a.clone(), b.clone()]);
        assert_eq!(height_px, 2 * (TOP_PX + 360 + BOTTOM_PX));
        assert_eq!(both, [pixels(&[a]).1, pixels(&[b]).1].concat());
    }

    #[test]
    fn the_legend_stands_where_nothing_is() {
        let points = vec![Point::origin(), Point::new(0.9, 0.9), Point::new(1.0, 1.0)];
        let curve = Curve { name: "a", rgb: [200, 0, 0], is_dashed: false, points };
        let plot = Plot { curves: vec![curve], ..Plot::default() };
        assert!(matches!(plot.emptiest_corner(&Axes::new(&plot)), SeriesLabelPosition::UpperLeft));
    }
}
