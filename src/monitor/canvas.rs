//! A part of the plane on a part of the screen: `ratatui`'s canvas with the same scale on both axes, and centred labels.
//!
//! Braille has 2 x 4 dots in a cell, and a terminal's cell is about twice as high as wide: dots lie on a square lattice.
//! Without Unicode there is one sign in a cell.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::Widget as _;
use ratatui::widgets::canvas::{Canvas, Context, Painter, Shape};
use slamd_core::Point;

/// A part of the plane in an area of the screen; the plane's y axis is up.
pub(super) struct Window {
    area: Rect,
    centre: Point,
    dot_m: f64,
}

/// Columns and rows of Braille dots in a cell.
const ACROSS: u16 = 2;
const DOWN: u16 = 4;

impl Window {
    /// `centre` is in the middle of `area`; a Braille dot is `dot_m` metres wide and high.
    pub(super) fn new(area: Rect, centre: Point, dot_m: f64) -> Self {
        Self { area, centre, dot_m }
    }

    /// Minimum size of a dot with which a piece of the plane fits into an area, metres.
    pub(super) fn fitting(area: Rect, width_m: f64, height_m: f64) -> f64 {
        let dots = |cells: u16, each: u16| f64::from((cells * each).max(1));
        (width_m / dots(area.width, ACROSS)).max(height_m / dots(area.height, DOWN))
    }

    /// Columns and rows of Braille dots, each with the point in its middle.
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

    /// Draws with a marker: Braille, or one sign to a cell. What is in the buffer stays where nothing is drawn.
    pub(super) fn draw(&self, buffer: &mut Buffer, marker: Marker, paint: impl Fn(&mut Context<'_>)) {
        // The canvas takes its bounds for the middles of the first and the last dot.
        let (across, down) = dots_per_mark(marker);
        let half = |cells: u16, each: u16, per_mark: u16| {
            let marks = cells * each / per_mark;
            // A single mark has no width: any bounds about the centre will do.
            0.5 * self.dot_m * f64::from(per_mark) * f64::from(marks.saturating_sub(1).max(1))
        };
        let (x, y) = (half(self.area.width, ACROSS, across), half(self.area.height, DOWN, down));
        Canvas::default()
            .marker(marker)
            .x_bounds([self.centre.x - x, self.centre.x + x])
            .y_bounds([self.centre.y - y, self.centre.y + y])
            .paint(paint)
            .render(self.area.intersection(buffer.area), buffer);
    }

    /// Text whose middle lies at a point, kept within the area.
    pub(super) fn label(&self, buffer: &mut Buffer, at: Point, text: &str, style: Style) {
        let Some((column, row)) = self.dot(at) else { return };
        let width = u16::try_from(text.chars().count()).unwrap_or(u16::MAX).min(self.area.width);
        let x = (column / ACROSS).saturating_sub(width / 2).min(self.area.width - width);
        let (x, y) = (self.area.x + x, self.area.y + row / DOWN);
        // The dots' colour must not shine through.
        for x in x..x + width {
            if let Some(cell) = buffer.cell_mut((x, y)) {
                cell.reset();
            }
        }
        buffer.set_stringn(x, y, text, usize::from(width), style);
    }

    fn dot(&self, at: Point) -> Option<(u16, u16)> {
        let (width, height) = (self.area.width * ACROSS, self.area.height * DOWN);
        let column = libm::floor((at.x - self.centre.x) / self.dot_m + 0.5 * f64::from(width));
        let row = libm::floor((self.centre.y - at.y) / self.dot_m + 0.5 * f64::from(height));
        let is_inside = (0.0..f64::from(width)).contains(&column) && (0.0..f64::from(height)).contains(&row);
        is_inside.then(|| (whole(column), whole(row)))
    }
}

/// Braille dots by column and row, drawn with any marker.
pub(super) struct Dots<'a> {
    /// Columns and rows.
    pub dots: &'a [(u16, u16)],
    /// What the canvas draws with.
    pub marker: Marker,
    /// The colour of their cells.
    pub colour: Color,
}

impl Shape for Dots<'_> {
    fn draw(&self, painter: &mut Painter<'_, '_>) {
        let (across, down) = dots_per_mark(self.marker);
        for (column, row) in self.dots {
            painter.paint(usize::from(column / across), usize::from(row / down), self.colour);
        }
    }
}

/// Columns and rows of Braille dots that one mark covers.
fn dots_per_mark(marker: Marker) -> (u16, u16) {
    if marker == Marker::Braille { (1, 1) } else { (ACROSS, DOWN) }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the area")]
fn whole(number: f64) -> u16 {
    number as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::widgets::canvas::Line;

    fn drawn(draw: impl Fn(&Window, &mut Buffer)) -> Vec<String> {
        let area = Rect::new(0, 0, 4, 2);
        let mut buffer = Buffer::empty(area);
        draw(&Window::new(area, Point::origin(), 1.0), &mut buffer);
        buffer.content().chunks(4).map(|cells| cells.iter().map(|cell| cell.symbol()).collect()).collect()
    }

    #[test]
    fn a_line_is_cut_off_at_the_edges() {
        let line = |marker| {
            drawn(move |window, buffer| {
                window.draw(buffer, marker, |canvas| canvas.draw(&Line::new(-90.0, -0.5, 90.0, -0.5, Color::Red)));
            })
        };
        assert_eq!(line(Marker::Braille), ["    ", "⠉⠉⠉⠉"]);
        assert_eq!(line(Marker::Custom('#')), ["    ", "####"]);
    }

    #[test]
    fn y_is_up_and_dots_gather_in_a_cell() {
        let points = |marker| {
            drawn(move |window, buffer| {
                window.draw(buffer, marker, |canvas| {
                    canvas.draw(&Line::new(-3.5, 3.5, -3.5, 3.5, Color::Red));
                    canvas.draw(&Line::new(-2.5, 0.5, -2.5, 0.5, Color::Red));
                });
            })
        };
        assert_eq!(points(Marker::Braille), ["⢁   ", "    "]);
    }

    #[test]
    fn a_dot_is_the_same_with_every_marker() {
        let dots = |marker| {
            drawn(move |window, buffer| {
                let dots = Dots { dots: &[(7, 0), (0, 7)], marker, colour: Color::Red };
                window.draw(buffer, marker, |canvas| canvas.draw(&dots));
            })
        };
        assert_eq!(dots(Marker::Braille), ["   ⠈", "⡀   "]);
        assert_eq!(dots(Marker::Custom('#')), ["   #", "#   "]);
    }

    #[test]
    fn a_label_stays_inside() {
        let label = |window: &Window, buffer: &mut Buffer| {
            window.label(buffer, Point::new(3.9, 3.0), "21", Style::new());
        };
        assert_eq!(drawn(label), ["  21", "    "]);
    }

    #[test]
    fn points_of_dots_are_those_that_a_label_finds() {
        let window = Window::new(Rect::new(3, 1, 5, 3), Point::new(0.3, -7.0), 0.07);
        assert_eq!(window.dots().count(), 5 * 2 * 3 * 4);
        assert!(window.dots().all(|(dot, point)| window.dot(point) == Some(dot)));
    }
}
