//! The layout of the screen.

use crate::monitor::dashboard::{Dashboard, Tone};
use crate::monitor::view::{Look, View};
use crate::monitor::{map, numbers, ring};
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier};
use ratatui::text::{Line, Span, Text};
use ratatui::widgets::{Block, Paragraph, Widget as _, Wrap};
use slamd_core::Timestamp;

/// Minimum width of a legible screen, columns.
pub const MIN_WIDTH: u16 = 80;
/// The same, rows.
pub const MIN_HEIGHT: u16 = 24;

/// Rows of title and link; of the pictures at least; of keys.
const HEAD: u16 = 3;
const PICTURES: u16 = 13;
const KEYS: u16 = 1;
/// Columns of the numbers.
const NUMBERS: u16 = 28;
/// A frame takes this much of both.
const FRAME: u16 = 2;

/// Draws one picture over the whole area. `log` is the last lines of the log, oldest first.
pub fn draw(area: Rect, buffer: &mut Buffer, dashboard: &Dashboard, log: &[String], view: View, look: Look) {
    if area.width < MIN_WIDTH || area.height < MIN_HEIGHT {
        let words = format!(
            "This terminal has {} columns and {} rows; slamd monitor needs {MIN_WIDTH} and {MIN_HEIGHT}. q quits.",
            area.width, area.height
        );
        Paragraph::new(words).wrap(Wrap { trim: true }).render(area, buffer);
        return;
    }
    let words = WORDS + (area.height - MIN_HEIGHT) / 3;
    let rows = [Constraint::Length(HEAD), Constraint::Fill(1), Constraint::Length(words), Constraint::Length(KEYS)];
    let [head, pictures, words, keys] = Layout::vertical(rows).areas(area);
    // As wide as high: a cell is twice as high as wide.
    let round = (2 * (pictures.height - FRAME) + FRAME).min((area.width - NUMBERS) / 2);
    let columns = [Constraint::Length(round), Constraint::Length(NUMBERS), Constraint::Fill(1)];
    let [left, middle, right] = Layout::horizontal(columns).areas(pictures);
    let [faults, lines] = Layout::horizontal([Constraint::Ratio(1, 2); 2]).areas(words);

    title(head, buffer, dashboard, view, look);
    let inside = frame(left, buffer, "ring, front up", &ring::census(dashboard), look);
    ring::draw(inside, buffer, dashboard, look);
    let inside = frame(middle, buffer, "rates, pose, wheels", "", look);
    Paragraph::new(numbers::lines(dashboard, look)).render(inside, buffer);
    let about = if view.follow { "map about the robot" } else { "map" };
    let inside = frame(right, buffer, about, &map::scale_bar(inside_of(right), dashboard, view, look), look);
    map::draw(inside, buffer, dashboard, view, look);
    let about = match (dashboard.session.doubted_models().count(), dashboard.session.faulty().count()) {
        (0, faulty) => format!("faulty sensors: {faulty}"),
        (doubts, faulty) => format!("doubts: {doubts}, faulty sensors: {faulty}"),
    };
    let inside = frame(faults, buffer, &about, "", look);
    reasons(inside, buffer, dashboard, look);
    let inside = frame(lines, buffer, "log", "", look);
    tail(inside, buffer, log, look);
    let keys_told = if view.help { ALL_KEYS } else { FEW_KEYS };
    buffer.set_stringn(keys.x, keys.y, keys_told, usize::from(keys.width), look.faint());
}

/// Rows for faults and log at the least height: what is left.
const WORDS: u16 = MIN_HEIGHT - HEAD - KEYS - PICTURES;
const FEW_KEYS: &str = " q quit   + - zoom   ? all keys";
const ALL_KEYS: &str = " q, Esc, Ctrl-C quit   + - zoom   c about robot or map   p pause   ? fewer";

/// A frame with a title above and one below; what it leaves inside.
fn frame(area: Rect, buffer: &mut Buffer, above: &str, below: &str, look: Look) -> Rect {
    let padded = |title: &str| if title.is_empty() { String::new() } else { format!(" {title} ") };
    let block = Block::bordered()
        .border_set(look.border())
        .border_style(look.faint())
        .title_top(Span::raw(padded(above)))
        .title_bottom(Line::raw(padded(below)).right_aligned());
    let inside = block.inner(area);
    block.render(area, buffer);
    inside
}

/// The session's time, hours, minutes and seconds.
#[must_use]
pub fn clock(at: Timestamp) -> String {
    let whole = at.us() / 1_000_000;
    format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
}

/// What a frame leaves inside.
fn inside_of(area: Rect) -> Rect {
    area.inner(ratatui::layout::Margin::new(1, 1))
}

fn title(area: Rect, buffer: &mut Buffer, dashboard: &Dashboard, view: View, look: Look) {
    let clock = clock(dashboard.session.at);
    let robot = look.text(&dashboard.session.robot);
    let mut first =
        vec![Span::styled(" slamd monitor", look.tone(Tone::Good)), Span::raw(format!("  {robot}  {clock}"))];
    if view.paused {
        first.push(Span::styled("  paused: p goes on", look.tone(Tone::Busy)));
    }
    let line = &dashboard.line;
    let second = Line::from(vec![
        Span::styled(format!(" {} ", line.word), look.tone(line.tone).add_modifier(Modifier::REVERSED)),
        Span::raw(format!(" {}", look.text(&line.cause))),
    ]);
    Paragraph::new(Text::from(vec![Line::from(first), second])).wrap(Wrap { trim: false }).render(area, buffer);
}

/// What differs from the configuration, which sensors are ignored and why, newest first, and how many did not fit.
fn reasons(area: Rect, buffer: &mut Buffer, dashboard: &Dashboard, look: Look) {
    let mut faults: Vec<_> = dashboard.session.faulty().collect();
    let doubts: Vec<String> = dashboard.session.doubted_models().map(|event| look.text(&event.sentence())).collect();
    if faults.is_empty() && doubts.is_empty() {
        buffer.set_stringn(area.x, area.y, "none", usize::from(area.width), look.faint());
        return;
    }
    faults.sort_by_key(|fault| std::cmp::Reverse(fault.at));
    let red = look.ink(Color::Red);
    let reasons = faults.iter().map(|fault| look.text(fault.reason.strip_prefix("sensor ").unwrap_or(&fault.reason)));
    let whole: Vec<String> = doubts.into_iter().chain(reasons).collect();
    let wrapped = Paragraph::new(whole.join("\n")).style(red).wrap(Wrap { trim: true });
    let (room, width) = (usize::from(area.height), usize::from(area.width));
    // Broken between words, a line may take one row more than its letters do.
    let rows = |reason: &String| match reason.chars().count() {
        letters if letters <= width => 1,
        letters => letters.div_ceil(width) + 1,
    };
    if whole.iter().map(rows).sum::<usize>() <= room {
        return wrapped.render(area, buffer);
    }
    let shown = if whole.len() > room { room.saturating_sub(1) } else { whole.len() };
    let mut lines: Vec<Line<'_>> =
        whole.iter().take(shown).map(|reason| Line::styled(fit(reason, area.width, look), red)).collect();
    if shown < whole.len() {
        lines.push(Line::styled(format!("and {} more", whole.len() - shown), look.faint()));
    }
    Paragraph::new(lines).render(area, buffer);
}

/// The last lines that fit.
fn tail(area: Rect, buffer: &mut Buffer, log: &[String], look: Look) {
    let skipped = log.len().saturating_sub(usize::from(area.height));
    let lines: Vec<Line<'_>> = log
        .iter()
        .skip(skipped)
        .map(|line| {
            let tone = if line.contains(" WARN ") || line.contains(" ERROR ") { Some(Tone::Busy) } else { None };
            let style = tone.map(|tone| look.tone(tone).remove_modifier(Modifier::BOLD)).unwrap_or_default();
            Line::styled(fit(&look.text(line), area.width, look), style)
        })
        .collect();
    Paragraph::new(lines).render(area, buffer);
}

/// Text cut to a width; a sign at its end shows the cut.
fn fit(text: &str, width: u16, look: Look) -> String {
    let width = usize::from(width);
    if text.chars().count() <= width {
        return text.into();
    }
    let more = if look.unicode { "…" } else { "~" };
    text.chars().take(width.saturating_sub(1)).collect::<String>() + more
}
