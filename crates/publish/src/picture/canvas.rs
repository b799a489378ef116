//! Lines, discs and words on a picture, in pixels from the upper left corner.

use super::surface::{Direction, Ink, Pen, Pixel, SIZE, Surface, WEIGHT};
use noto_sans_mono_bitmap::{get_raster, get_raster_width};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PremultipliedColorU8, Stroke, StrokeDash,
    Transform,
};

/// The picture being drawn.
pub(super) struct Canvas {
    pixmap: Pixmap,
    background: Ink,
    /// What everything is moved by, pixels.
    offset: (usize, usize),
}

impl Canvas {
    /// An empty picture, at least one pixel.
    pub(super) fn new(width: usize, height: usize, background: Ink) -> Self {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(MAX_SIDE).clamp(1, MAX_SIDE);
        let mut pixmap = Pixmap::new(side(width), side(height)).expect("sides are within bounds");
        pixmap.fill(color(background));
        Self { pixmap, background, offset: (0, 0) }
    }

    /// Colours one pixel; outside the picture nothing happens.
    fn set(&mut self, column: usize, row: usize, [red, green, blue, _]: Ink) {
        let width = self.pixmap.width() as usize;
        let solid = PremultipliedColorU8::from_rgba(red, green, blue, u8::MAX);
        let pixel = (column < width).then(|| self.pixmap.pixels_mut().get_mut(row * width + column)).flatten();
        if let (Some(pixel), Some(solid)) = (pixel, solid) {
            *pixel = solid;
        }
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// Where the picture is too large for the format.
    pub(super) fn into_png(self) -> std::io::Result<Vec<u8>> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.pixmap.width(), self.pixmap.height());
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::Fast);
        // The opacity is dropped within the buffer: the ground is opaque, and a small board has no memory for a second picture.
        let mut bytes = self.pixmap.take();
        let pixels = bytes.len() / 4;
        (0..pixels).for_each(|pixel| bytes.copy_within(4 * pixel..4 * pixel + 3, 3 * pixel));
        encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes[..3 * pixels]))?;
        Ok(file)
    }

    fn moved(&self) -> Transform {
        Transform::from_translate(single(self.offset.0 as f64), single(self.offset.1 as f64))
    }

    fn stroke(&mut self, path: &Path, pen: Pen) {
        let stroke = Stroke {
            width: single(pen.width_px),
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash: pen.dash_px.and_then(|(on, off)| StrokeDash::new(vec![single(on), single(off)], 0.0)),
            ..Stroke::default()
        };
        self.pixmap.stroke_path(path, &paint(pen.ink), &stroke, self.moved(), None);
    }

    fn fill(&mut self, path: &Path, ink: Ink) {
        self.pixmap.fill_path(path, &paint(ink), FillRule::Winding, self.moved(), None);
    }

    /// Mixes ink into a pixel; outside the picture nothing happens.
    fn blend(&mut self, (column, row): (usize, usize), ink: Ink, intensity: u8) {
        let pixel = (u32::try_from(column), u32::try_from(row));
        let below = if let (Ok(column), Ok(row)) = pixel { self.pixmap.pixel(column, row) } else { None };
        if let Some(below) = below {
            let mixed = mix([below.red(), below.green(), below.blue(), u8::MAX], ink, f64::from(intensity) / 255.0);
            self.set(column, row, mixed);
        }
    }
}

impl Surface for Canvas {
    fn width_px(&self) -> f64 {
        f64::from(self.pixmap.width())
    }

    fn rectangle(&mut self, (left, top): (usize, usize), (width, height): (usize, usize), ink: Ink) {
        let (left, top) = (left + self.offset.0, top + self.offset.1);
        (top..top + height).for_each(|row| (left..left + width).for_each(|column| self.set(column, row, ink)));
    }

    fn polyline(&mut self, points: &[Pixel], pen: Pen) {
        if let Some(path) = path(points, false) {
            self.stroke(&path, pen);
        }
    }

    fn polygon(&mut self, points: &[Pixel], ink: Ink) {
        if let Some(path) = path(points, true) {
            self.fill(&path, ink);
        }
    }

    fn disc(&mut self, (x, y): Pixel, radius_px: f64, ink: Ink) {
        if let Some(path) = PathBuilder::from_circle(single(x), single(y), single(radius_px)) {
            self.fill(&path, ink);
        }
    }

    fn circle(&mut self, (x, y): Pixel, radius_px: f64, pen: Pen) {
        if let Some(path) = PathBuilder::from_circle(single(x), single(y), single(radius_px)) {
            self.stroke(&path, pen);
        }
    }

    fn text(&mut self, (x, y): Pixel, words: &str, ink: Ink, direction: Direction) {
        let advance = get_raster_width(WEIGHT, SIZE);
        let (x, y) = (whole(x) + self.offset.0, whole(y) + self.offset.1);
        for (index, letter) in words.chars().enumerate() {
            let Some(raster) = get_raster(letter, WEIGHT, SIZE).or_else(|| get_raster('?', WEIGHT, SIZE)) else {
                continue;
            };
            for (row, intensities) in raster.rows().enumerate() {
                for (column, &intensity) in intensities.iter().enumerate() {
                    let along = index * advance + column;
                    let pixel = match direction {
                        Direction::Right => Some((x + along, y + row)),
                        Direction::Up => y.checked_sub(along).map(|y| (x + row, y)),
                    };
                    if let Some(pixel) = pixel {
                        self.blend(pixel, ink, intensity);
                    }
                }
            }
        }
    }

    fn layer(&mut self, _name: &str) {}

    fn within(&mut self, corner: (usize, usize), size: (usize, usize), draw: &mut dyn FnMut(&mut dyn Surface)) {
        self.offset = corner;
        draw(self);
        self.offset = (0, 0);
        let (columns, rows) = (corner.0..corner.0 + size.0, corner.1..corner.1 + size.1);
        // A mask would be one more picture in memory.
        for row in 0..self.pixmap.height() as usize {
            for column in 0..self.pixmap.width() as usize {
                if !(columns.contains(&column) && rows.contains(&row)) {
                    self.set(column, row, self.background);
                }
            }
        }
    }
}

/// A path through points; none through a single one.
fn path(points: &[Pixel], is_closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for &(x, y) in points {
        if builder.is_empty() {
            builder.move_to(single(x), single(y));
        } else {
            builder.line_to(single(x), single(y));
        }
    }
    if is_closed {
        builder.close();
    }
    builder.finish()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates; what is outside is not drawn")]
fn whole(pixels: f64) -> usize {
    pixels.max(0.0).round().min(1e6) as usize
}

/// `from` where `part` is 0, `to` where it is 1.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two bytes")]
pub(super) fn mix(from: Ink, to: Ink, part: f64) -> Ink {
    std::array::from_fn(|i| {
        let (from, to) = (f64::from(from[i]), f64::from(to[i]));
        (from + part.clamp(0.0, 1.0) * (to - from)).round() as u8
    })
}

fn paint(ink: Ink) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(color(ink));
    paint
}

fn color([red, green, blue, opacity]: Ink) -> Color {
    Color::from_rgba8(red, green, blue, opacity)
}

#[expect(clippy::cast_possible_truncation, reason = "a seventh digit of a pixel is not seen")]
const fn single(pixels: f64) -> f32 {
    pixels as f32
}

/// Longest side of a picture, pixels.
const MAX_SIDE: u32 = 8192;
