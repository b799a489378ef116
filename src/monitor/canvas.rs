//! Drawing with the dots of Braille characters, 2 x 4 to a cell; where the terminal has no Unicode, with one sign to a cell.
//!
//! A terminal's cell is about twice as high as wide, so Braille dots lie on a square lattice; ASCII signs do not.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use slamd_core::Point;

/// What a dot is drawn with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    /// Its sign where there are no Braille dots.
    pub ascii: char,
    /// The colour of its whole cell: the last pen wins.
    pub style: Style,
}

/// A part of the plane in a part of the screen; the plane's y axis is up.
pub(super) struct Canvas<'a> {
    buffer: &'a mut Buffer,
    area: Rect,
    unicode: bool,
    centre: Point,
    dot_m: f64,
}

/// Dots of a cell.
const ACROSS: u16 = 2;
const DOWN: u16 = 4;
/// The bits of Braille's dots by row and column (Unicode, chapter 21.1).
const BITS: [[u8; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
const BRAILLE: u32 = 0x2800;

impl<'a> Canvas<'a> {
    /// A canvas over `area` with `centre` in its middle and `dot_m` metres to a Braille dot.
    pub(super) fn new(buffer: &'a mut Buffer, area: Rect, unicode: bool, centre: Point, dot_m: f64) -> Self {
        let area = area.intersection(buffer.area);
        Self { buffer, area, unicode, centre, dot_m }
    }

    /// The least size of a dot with which a piece of the plane fits into an area, metres.
    pub(super) fn fitting(area: Rect, width_m: f64, height_m: f64) -> f64 {
        let dots = |cells: u16, each: u16| f64::from((cells * each).max(1));
        (width_m / dots(area.width, ACROSS)).max(height_m / dots(area.height, DOWN))
    }

    /// Rows and columns of dots, each with the point in its middle.
    pub(super) fn dots(&self) -> impl Iterator<Item = ((u16, u16), Point)> + use<> {
        let (width, height) = (self.area.width * ACROSS, self.area.height * DOWN);
        let (centre, dot_m) = (self.centre, self.dot_m);
        (0..height).flat_map(move |row| {
            (0..width).map(move |column| {
                let x = centre.x + dot_m * (f64::from(column) + 0.5 - 0.5 * f64::from(width));
                let y = centre.y - dot_m * (f64::from(row) + 0.5 - 0.5 * f64::from(height));
                ((column, row), Point::new(x, y))
            })
        })
    }

    /// Sets a dot by column and row.
    pub(super) fn set(&mut self, (column, row): (u16, u16), pen: Pen) {
        let (x, y) = (self.area.x + column / ACROSS, self.area.y + row / DOWN);
        let Some(cell) = self.buffer.cell_mut((x, y)) else { return };
        if self.unicode {
            let dots = cell.symbol().chars().next().map_or(0, u32::from).checked_sub(BRAILLE);
            let bit = BITS[usize::from(row % DOWN)][usize::from(column % ACROSS)];
            let dots = dots.filter(|dots| *dots < 0x100).unwrap_or(0) | u32::from(bit);
            cell.set_char(char::from_u32(BRAILLE + dots).unwrap_or(' '));
        } else {
            cell.set_char(pen.ascii);
        }
        cell.set_style(pen.style);
    }

    /// A straight line; what lies outside is cut off.
    pub(super) fn line(&mut self, from: Point, to: Point, pen: Pen) {
        let steps = ((to - from).norm() / self.dot_m * 1.5).clamp(1.0, MAX_STEPS);
        for step in 0..=whole(steps) {
            let part = f64::from(step) / steps.floor();
            if let Some(dot) = self.dot(from + (to - from) * part) {
                self.set(dot, pen);
            }
        }
    }

    /// Text whose middle lies at a point, kept within the area.
    pub(super) fn label(&mut self, at: Point, text: &str, style: Style) {
        let Some((column, row)) = self.dot(at) else { return };
        let width = u16::try_from(text.chars().count()).unwrap_or(u16::MAX).min(self.area.width);
        let x = (column / ACROSS).saturating_sub(width / 2).min(self.area.width - width);
        let (x, y) = (self.area.x + x, self.area.y + row / DOWN);
        // The dots' colour must not shine through.
        for x in x..x + width {
            if let Some(cell) = self.buffer.cell_mut((x, y)) {
                cell.reset();
            }
        }
        self.buffer.set_stringn(x, y, text, usize::from(width), style);
    }

    fn dot(&self, at: Point) -> Option<(u16, u16)> {
        let (width, height) = (self.area.width * ACROSS, self.area.height * DOWN);
        let column = libm::floor((at.x - self.centre.x) / self.dot_m + 0.5 * f64::from(width));
        let row = libm::floor((self.centre.y - at.y) / self.dot_m + 0.5 * f64::from(height));
        let inside = (0.0..f64::from(width)).contains(&column) && (0.0..f64::from(height)).contains(&row);
        inside.then(|| (whole(column), whole(row)))
    }
}

/// A line on no screen has more dots.
const MAX_STEPS: f64 = 4_000.0;

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place on a screen")]
fn whole(number: f64) -> u16 {
    number as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(unicode: bool, draw: impl Fn(&mut Canvas<'_>)) -> Vec<String> {
        let area = Rect::new(0, 0, 4, 2);
        let mut buffer = Buffer::empty(area);
        draw(&mut Canvas::new(&mut buffer, area, unicode, Point::origin(), 1.0));
        buffer.content().chunks(4).map(|cells| cells.iter().map(|cell| cell.symbol()).collect()).collect()
    }

    const PEN: Pen = Pen { ascii: '#', style: Style::new() };

    #[test]
    fn a_line_is_cut_off_at_the_edges() {
        let line = |canvas: &mut Canvas<'_>| canvas.line(Point::new(-90.0, -0.5), Point::new(90.0, -0.5), PEN);
        assert_eq!(drawn(true, line), ["    ", "⠉⠉⠉⠉"]);
        assert_eq!(drawn(false, line), ["    ", "####"]);
    }

    #[test]
    fn y_is_up_and_dots_gather_in_a_cell() {
        let dots = |canvas: &mut Canvas<'_>| {
            canvas.line(Point::new(-3.5, 3.5), Point::new(-3.5, 3.5), PEN);
            canvas.line(Point::new(-2.5, 0.5), Point::new(-2.5, 0.5), PEN);
        };
        assert_eq!(drawn(true, dots), ["⢁   ", "    "]);
    }

    #[test]
    fn a_label_stays_inside() {
        let label = |canvas: &mut Canvas<'_>| canvas.label(Point::new(3.9, 3.0), "21", Style::new());
        assert_eq!(drawn(true, label), ["  21", "    "]);
    }

    #[test]
    fn points_of_dots_are_those_that_a_line_would_set() {
        let area = Rect::new(3, 1, 5, 3);
        let mut buffer = Buffer::empty(Rect::new(0, 0, 20, 10));
        let canvas = Canvas::new(&mut buffer, area, true, Point::new(0.3, -7.0), 0.07);
        assert_eq!(canvas.dots().count(), 5 * 2 * 3 * 4);
        assert!(canvas.dots().all(|(dot, point)| canvas.dot(point) == Some(dot)));
    }
}
