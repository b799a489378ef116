//! Lines, discs and words on a picture, in pixels from the upper left corner.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PremultipliedColorU8, Stroke, StrokeDash,
    Transform,
};

/// A point of the picture: pixels to the right and down.
pub(super) type Pixel = (f64, f64);

/// Red, green, blue and opacity.
pub(super) type Ink = [u8; 4];

/// The picture being drawn.
pub(super) struct Canvas {
    pixmap: Pixmap,
    background: Ink,
    /// What lines and discs are moved by.
    moved: Transform,
}

/// How a line is drawn.
#[derive(Clone, Copy)]
pub(super) struct Pen {
    pub(super) ink: Ink,
    pub(super) width_px: f64,
    /// Pixels drawn and left out in turn; none for a solid line.
    pub(super) dash_px: Option<(f64, f64)>,
}

impl Pen {
    pub(super) const fn solid(ink: Ink, width_px: f64) -> Self {
        Self { ink, width_px, dash_px: None }
    }
}

/// Height of a line of text, pixels.
pub(super) const TEXT_PX: f64 = 20.0;

impl Canvas {
    /// An empty picture, at least one pixel.
    pub(super) fn new(width: usize, height: usize, background: Ink) -> Self {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(MAX_SIDE).clamp(1, MAX_SIDE);
        let mut pixmap = Pixmap::new(side(width), side(height)).expect("sides are within bounds");
        pixmap.fill(color(background));
        Self { pixmap, background, moved: Transform::identity() }
    }

    pub(super) fn width_px(&self) -> f64 {
        f64::from(self.pixmap.width())
    }

    /// Colours one pixel; outside the picture nothing happens.
    pub(super) fn set(&mut self, column: usize, row: usize, [red, green, blue, _]: Ink) {
        let width = self.pixmap.width() as usize;
        let solid = PremultipliedColorU8::from_rgba(red, green, blue, u8::MAX);
        let pixel = (column < width).then(|| self.pixmap.pixels_mut().get_mut(row * width + column)).flatten();
        if let (Some(pixel), Some(solid)) = (pixel, solid) {
            *pixel = solid;
        }
    }

    pub(super) fn polyline(&mut self, points: impl IntoIterator<Item = Pixel>, pen: Pen) {
        let mut builder = PathBuilder::new();
        for (x, y) in points {
            if builder.is_empty() {
                builder.move_to(single(x), single(y));
            } else {
                builder.line_to(single(x), single(y));
            }
        }
        if let Some(path) = builder.finish() {
            self.stroke(&path, pen);
        }
    }

    pub(super) fn polygon(&mut self, points: impl IntoIterator<Item = Pixel>, ink: Ink) {
        let mut builder = PathBuilder::new();
        for (x, y) in points {
            if builder.is_empty() {
                builder.move_to(single(x), single(y));
            } else {
                builder.line_to(single(x), single(y));
            }
        }
        builder.close();
        if let Some(path) = builder.finish() {
            self.fill(&path, ink);
        }
    }

    pub(super) fn disc(&mut self, (x, y): Pixel, radius_px: f64, ink: Ink) {
        if let Some(path) = PathBuilder::from_circle(single(x), single(y), single(radius_px)) {
            self.fill(&path, ink);
        }
    }

    pub(super) fn circle(&mut self, (x, y): Pixel, radius_px: f64, pen: Pen) {
        if let Some(path) = PathBuilder::from_circle(single(x), single(y), single(radius_px)) {
            self.stroke(&path, pen);
        }
    }

    /// Two crossing strokes.
    pub(super) fn cross(&mut self, (x, y): Pixel, arm_px: f64, pen: Pen) {
        self.polyline([(x - arm_px, y - arm_px), (x + arm_px, y + arm_px)], pen);
        self.polyline([(x - arm_px, y + arm_px), (x + arm_px, y - arm_px)], pen);
    }

    /// Writes words whose upper left corner is at `at`.
    pub(super) fn text(&mut self, at: Pixel, words: &str, ink: Ink) {
        let advance = get_raster_width(WEIGHT, SIZE);
        for (index, letter) in words.chars().enumerate() {
            let Some(raster) = get_raster(letter, WEIGHT, SIZE).or_else(|| get_raster('?', WEIGHT, SIZE)) else {
                continue;
            };
            for (row, intensities) in raster.rows().enumerate() {
                for (column, &intensity) in intensities.iter().enumerate() {
                    self.blend(at, (index * advance + column, row), ink, intensity);
                }
            }
        }
    }

    /// The width of words, pixels.
    pub(super) fn text_width_px(words: &str) -> f64 {
        (words.chars().count() * get_raster_width(WEIGHT, SIZE)) as f64
    }

    /// Draws lines and discs in a part of the picture, in pixels from its upper left corner. Clears the picture around it.
    pub(super) fn within(&mut self, corner: (usize, usize), size: (usize, usize), draw: impl FnOnce(&mut Self)) {
        self.moved = Transform::from_translate(single(corner.0 as f64), single(corner.1 as f64));
        draw(self);
        self.moved = Transform::identity();
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

    fn stroke(&mut self, path: &Path, pen: Pen) {
        let stroke = Stroke {
            width: single(pen.width_px),
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash: pen.dash_px.and_then(|(on, off)| StrokeDash::new(vec![single(on), single(off)], 0.0)),
            ..Stroke::default()
        };
        self.pixmap.stroke_path(path, &paint(pen.ink), &stroke, self.moved, None);
    }

    fn fill(&mut self, path: &Path, ink: Ink) {
        self.pixmap.fill_path(path, &paint(ink), FillRule::Winding, self.moved, None);
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "text stands inside the picture")]
    fn blend(&mut self, (x, y): Pixel, (column, row): (usize, usize), ink: Ink, intensity: u8) {
        let (column, row) = (x.max(0.0) as usize + column, y.max(0.0) as usize + row);
        let pixel = (u32::try_from(column), u32::try_from(row));
        let below = if let (Ok(column), Ok(row)) = pixel { self.pixmap.pixel(column, row) } else { None };
        if let Some(below) = below {
            let mixed = mix([below.red(), below.green(), below.blue(), u8::MAX], ink, f64::from(intensity) / 255.0);
            self.set(column, row, mixed);
        }
    }
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

const WEIGHT: FontWeight = FontWeight::Regular;
const SIZE: RasterHeight = RasterHeight::Size20;
/// Longest side of a picture, pixels.
const MAX_SIDE: u32 = 8192;
