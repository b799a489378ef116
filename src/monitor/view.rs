//! How it is shown: what the terminal can do, and what the user has chosen with the keys.

use crate::monitor::dashboard::Tone;
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::{Marker, border};

/// What the terminal can do.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// It shows Unicode; else ASCII alone is used.
    pub unicode: bool,
    /// Colours are wanted; the states differ in their signs, too.
    pub colour: bool,
}

impl Look {
    /// From the environment: the locale's variables in the order POSIX gives them, and `NO_COLOR` (<https://no-color.org>).
    #[must_use]
    pub fn new(variable: impl Fn(&str) -> Option<String>) -> Self {
        let set = |name| variable(name).filter(|value| !value.is_empty());
        let locale = set("LC_ALL").or_else(|| set("LC_CTYPE")).or_else(|| set("LANG")).unwrap_or_default();
        let locale = locale.to_ascii_lowercase();
        Self { unicode: locale.contains("utf-8") || locale.contains("utf8"), colour: set("NO_COLOR").is_none() }
    }

    /// One of the terminal's 16 colours, where colours are wanted.
    pub(super) fn ink(self, colour: Color) -> Style {
        if self.colour { Style::new().fg(colour) } else { Style::new() }
    }

    /// The same for a canvas, which takes no style: the terminal's own colour where none are wanted.
    pub(super) fn colour(self, colour: Color) -> Color {
        if self.colour { colour } else { Color::Reset }
    }

    /// What dots are drawn with; `ascii` where there is no Unicode.
    pub(super) fn marker(self, ascii: char) -> Marker {
        if self.unicode { Marker::Braille } else { Marker::Custom(ascii) }
    }

    pub(super) fn tone(self, tone: Tone) -> Style {
        let colour = match tone {
            Tone::Good => Color::Green,
            Tone::Busy => Color::Yellow,
            Tone::Bad => Color::Red,
        };
        self.ink(colour).add_modifier(Modifier::BOLD)
    }

    pub(super) fn faint(self) -> Style {
        if self.colour { Style::new().fg(Color::DarkGray) } else { Style::new().add_modifier(Modifier::DIM) }
    }

    pub(super) fn border(self) -> border::Set<'static> {
        if self.unicode { border::ROUNDED } else { ASCII_BORDER }
    }

    pub(super) fn plus_minus(self) -> &'static str {
        if self.unicode { "±" } else { "+-" }
    }

    pub(super) fn degree(self) -> &'static str {
        if self.unicode { "°" } else { " deg" }
    }

    /// Text that may come from anywhere, in what the terminal can show.
    pub(super) fn text(self, text: &str) -> String {
        let shown = |c: char| if c.is_control() || !(self.unicode || c.is_ascii()) { '?' } else { c };
        text.chars().map(shown).collect()
    }
}

const ASCII_BORDER: border::Set<'static> = border::Set {
    top_left: "+",
    top_right: "+",
    bottom_left: "+",
    bottom_right: "+",
    vertical_left: "|",
    vertical_right: "|",
    horizontal_top: "-",
    horizontal_bottom: "-",
};

/// What the user has chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct View {
    /// Steps of the map's zoom; 0 shows all that is known.
    pub zoom: i8,
    /// The map stays about the robot, not about its own middle.
    pub follow: bool,
    /// The picture is frozen; the session goes on.
    pub paused: bool,
    /// All keys are listed.
    pub help: bool,
}

const MAX_ZOOM: i8 = 12;

impl View {
    /// Acts on a key; false where it means nothing.
    pub fn key(&mut self, key: char) -> bool {
        match key {
            '+' | '=' => self.zoom = (self.zoom + 1).min(MAX_ZOOM),
            '-' | '_' => self.zoom = (self.zoom - 1).max(-MAX_ZOOM),
            'c' => self.follow = !self.follow,
            'p' => self.paused = !self.paused,
            '?' => self.help = !self.help,
            _ => return false,
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(variables: &[(&str, &str)]) -> Look {
        Look::new(|name| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).into()))
    }

    #[test]
    fn the_locale_decides_about_unicode() {
        assert!(look(&[("LANG", "en_GB.UTF-8")]).unicode);
        assert!(look(&[("LC_ALL", "C.utf8"), ("LANG", "C")]).unicode);
        assert!(!look(&[("LC_ALL", "C"), ("LANG", "en_GB.UTF-8")]).unicode, "LC_ALL comes first");
        assert!(look(&[("LC_ALL", ""), ("LC_CTYPE", ""), ("LANG", "C.UTF-8")]).unicode, "empty is as good as absent");
        assert!(!look(&[]).unicode);
    }

    #[test]
    fn no_color_counts_where_it_is_not_empty() {
        assert!(!look(&[("NO_COLOR", "1")]).colour);
        assert!(look(&[("NO_COLOR", "")]).colour);
    }

    #[test]
    fn keys_change_the_view_within_bounds() {
        let mut view = View::default();
        for _ in 0..100 {
            assert!(view.key('+'));
        }
        assert_eq!(view.zoom, MAX_ZOOM);
        assert!(view.key('c') && view.key('p') && view.key('?') && !view.key('x'));
        assert_eq!(view, View { zoom: MAX_ZOOM, follow: true, paused: true, help: true });
    }
}
