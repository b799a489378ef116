//! The picture as SVG: the same lines and words, in layers that a drawing program can hide.

use super::surface::{Direction, Ink, Pen, Pixel, Surface, TEXT_PX, text_width_px};
use std::fmt::Write as _;

/// The picture being written.
pub(super) struct Svg {
    width: usize,
    text: String,
    /// The open layer is to be closed.
    has_layer: bool,
    clips: usize,
}

impl Svg {
    /// An empty picture of this size in pixels, each of them `pixel_mm` millimetres on paper.
    pub(super) fn new(width: usize, height: usize, pixel_mm: f64, title: &str, background: Ink) -> Self {
        let mm = |pixels: usize| pixels as f64 * pixel_mm;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.2}mm\" height=\"{:.2}mm\" viewBox=\"0 0 {width} {height}\">\n",
            mm(width),
            mm(height)
        );
        line(&mut text, format_args!("<title>{}</title>", Escaped(title)));
        line(&mut text, format_args!("<rect width=\"100%\" height=\"100%\"{}/>", Fill(background)));
        Self { width, text, has_layer: false, clips: 0 }
    }

    /// The file.
    pub(super) fn into_text(mut self) -> String {
        self.end_layer();
        self.text += "</svg>\n";
        self.text
    }

    fn end_layer(&mut self) {
        if std::mem::take(&mut self.has_layer) {
            self.text += "</g>\n";
        }
    }

    fn element(&mut self, element: std::fmt::Arguments<'_>) {
        line(&mut self.text, element);
    }
}

impl Surface for Svg {
    fn width_px(&self) -> f64 {
        self.width as f64
    }

    fn rectangle(&mut self, (x, y): (usize, usize), (width, height): (usize, usize), ink: Ink) {
        self.element(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" shape-rendering=\"crispEdges\"{}/>",
            Fill(ink)
        ));
    }

    fn polyline(&mut self, points: &[Pixel], pen: Pen) {
        if points.len() > 1 {
            self.element(format_args!("<polyline points=\"{}\"{}/>", Points(points), Stroke(pen)));
        }
    }

    fn polygon(&mut self, points: &[Pixel], ink: Ink) {
        self.element(format_args!("<polygon points=\"{}\"{}/>", Points(points), Fill(ink)));
    }

    fn disc(&mut self, (x, y): Pixel, radius_px: f64, ink: Ink) {
        self.element(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius_px:.1}\"{}/>", Fill(ink)));
    }

    fn circle(&mut self, (x, y): Pixel, radius_px: f64, pen: Pen) {
        self.element(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius_px:.1}\"{}/>", Stroke(pen)));
    }

    fn text(&mut self, (x, y): Pixel, words: &str, ink: Ink, direction: Direction) {
        // The letters stand on a line at four fifths of the height.
        let (x, y, turn) = match direction {
            Direction::Right => (x, y + 0.8 * TEXT_PX, String::new()),
            Direction::Up => {
                let x = x + 0.8 * TEXT_PX;
                (x, y, format!(" transform=\"rotate(-90 {x:.1} {y:.1})\""))
            }
        };
        self.element(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-family=\"Noto Sans Mono,DejaVu Sans Mono,Courier New,monospace\" font-size=\"{:.0}\" textLength=\"{:.0}\" \
             lengthAdjust=\"spacingAndGlyphs\"{turn}{}>{}</text>",
            0.85 * TEXT_PX,
            text_width_px(words),
            Fill(ink),
            Escaped(words)
        ));
    }

    fn layer(&mut self, name: &str) {
        self.end_layer();
        self.has_layer = true;
        self.element(format_args!("<g id=\"{}\">", Escaped(name)));
    }

    fn within(
        &mut self,
        corner: (usize, usize),
        (width, height): (usize, usize),
        draw: &mut dyn FnMut(&mut dyn Surface),
    ) {
        self.end_layer();
        self.clips += 1;
        let clip = self.clips;
        self.element(format_args!(
            "<clipPath id=\"part-{clip}\"><rect width=\"{width}\" height=\"{height}\"/></clipPath>\n<g transform=\"translate({} {})\" \
             clip-path=\"url(#part-{clip})\">",
            corner.0, corner.1
        ));
        draw(self);
        self.end_layer();
        self.text += "</g>\n";
    }
}

/// Adds a line; writing to a string cannot fail.
fn line(text: &mut String, element: std::fmt::Arguments<'_>) {
    let _ = writeln!(text, "{element}");
}

/// `x,y x,y`, to a tenth of a pixel.
struct Points<'a>(&'a [Pixel]);

impl std::fmt::Display for Points<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, (x, y)) in self.0.iter().enumerate() {
            let space = if index > 0 { " " } else { "" };
            write!(f, "{space}{x:.1},{y:.1}")?;
        }
        Ok(())
    }
}

/// The attributes of a filled shape.
struct Fill(Ink);

impl std::fmt::Display for Fill {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [red, green, blue, opacity] = self.0;
        write!(f, " fill=\"#{red:02x}{green:02x}{blue:02x}\"")?;
        if opacity < u8::MAX { write!(f, " fill-opacity=\"{:.2}\"", f64::from(opacity) / 255.0) } else { Ok(()) }
    }
}

/// The attributes of a line.
struct Stroke(Pen);

impl std::fmt::Display for Stroke {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Pen { ink: [red, green, blue, opacity], width_px, dash_px } = self.0;
        write!(
            f,
            " fill=\"none\" stroke=\"#{red:02x}{green:02x}{blue:02x}\" stroke-width=\"{width_px:.1}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\""
        )?;
        if opacity < u8::MAX {
            write!(f, " stroke-opacity=\"{:.2}\"", f64::from(opacity) / 255.0)?;
        }
        dash_px.map_or(Ok(()), |(on, off)| write!(f, " stroke-dasharray=\"{on:.0} {off:.0}\""))
    }
}

/// Text of a document. What XML does not allow at all becomes a question mark.
struct Escaped<'a>(&'a str);

impl std::fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.chars().try_for_each(|letter| match letter {
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '&' => f.write_str("&amp;"),
            '"' => f.write_str("&quot;"),
            control if control.is_control() || matches!(control, '\u{fffe}' | '\u{ffff}') => f.write_str("?"),
            plain => write!(f, "{plain}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_words_stay_words() {
        let mut svg = Svg::new(10, 10, 0.25, "a<b>&\"\u{1}", [0, 0, 0, 255]);
        svg.text((0.0, 0.0), "</text><script>", [0, 0, 0, 255], Direction::Up);
        let text = svg.into_text();
        assert!(text.contains("<title>a&lt;b&gt;&amp;&quot;?</title>"), "{text}");
        assert!(text.contains("&lt;/text&gt;&lt;script&gt;</text>"), "{text}");
    }

    #[test]
    fn every_layer_is_closed() {
        let mut svg = Svg::new(10, 10, 0.25, "", [0, 0, 0, 255]);
        svg.layer("a");
        svg.within((1, 1), (2, 2), &mut |part| {
            part.layer("b");
            part.layer("c");
        });
        svg.layer("d");
        let text = svg.into_text();
        assert_eq!(text.matches("<g").count(), text.matches("</g>").count(), "{text}");
    }
}
