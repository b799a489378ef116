//! What a picture is drawn on: pixels or SVG.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster_width};

/// A point of the picture: pixels to the right and down.
pub(super) type Pixel = (f64, f64);

/// Red, green, blue and opacity.
pub(super) type Ink = [u8; 4];

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

/// The direction in which words run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    /// To the right.
    Right,
    /// Upwards.
    Up,
}

/// Height of a line of text, pixels.
pub(super) const TEXT_PX: f64 = 20.0;
pub(super) const WEIGHT: FontWeight = FontWeight::Regular;
pub(super) const SIZE: RasterHeight = RasterHeight::Size20;

/// The width of words, pixels.
pub(super) fn text_width_px(words: &str) -> f64 {
    (words.chars().count() * get_raster_width(WEIGHT, SIZE)) as f64
}

/// Something that can be drawn on. Everything is in pixels from the upper left corner.
pub(super) trait Surface {
    /// The width of the picture, pixels.
    fn width_px(&self) -> f64;

    /// Colours a rectangle of whole pixels, from its upper left corner.
    fn rectangle(&mut self, corner: (usize, usize), size: (usize, usize), ink: Ink);

    /// Draws a line through points.
    fn polyline(&mut self, points: &[Pixel], pen: Pen);

    /// Fills the area within points.
    fn polygon(&mut self, points: &[Pixel], ink: Ink);

    /// Fills a circle.
    fn disc(&mut self, centre: Pixel, radius_px: f64, ink: Ink);

    /// Draws a circle.
    fn circle(&mut self, centre: Pixel, radius_px: f64, pen: Pen);

    /// Writes words. The corner `at` is the upper left one of words that run to the right, and the lower left one of words that run upwards.
    fn text(&mut self, at: Pixel, words: &str, ink: Ink, direction: Direction);

    /// Names what is drawn from now on: a layer, where the format has layers.
    fn layer(&mut self, name: &str);

    /// Draws in a part of the picture, in pixels from its upper left corner; what lies outside is not shown.
    fn within(&mut self, corner: (usize, usize), size: (usize, usize), draw: &mut dyn FnMut(&mut dyn Surface));

    /// Two crossing strokes.
    fn cross(&mut self, (x, y): Pixel, arm_px: f64, pen: Pen) {
        self.polyline(&[(x - arm_px, y - arm_px), (x + arm_px, y + arm_px)], pen);
        self.polyline(&[(x - arm_px, y + arm_px), (x + arm_px, y - arm_px)], pen);
    }
}
