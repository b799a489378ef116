//! Logs of a serial monitor, whose lines begin with the computer's time: `12:00:01.123 -> 512,10,11`.

use super::dates;
use std::fmt::Write as _;

/// What stands between the time and the line.
const ARROW: &str = " -> ";
/// Share of the lines that must have it.
const MIN_SHARE: f64 = 0.8;
/// So many lines decide.
const PROBE: usize = 50;

/// The time and the rest of a line.
fn split(line: &str) -> Option<(&str, &str)> {
    let (time, rest) = line.split_once(ARROW.trim_end())?;
    dates::seconds(time.trim().trim_matches(['[', ']']))?;
    Some((time.trim().trim_matches(['[', ']']), rest.trim_start()))
}

/// What separates the cells of a line that a program has printed.
fn delimiter(line: &str) -> char {
    [',', ';', '\t'].into_iter().find(|delimiter| line.contains(*delimiter)).unwrap_or(' ')
}

/// The text without the times of a serial monitor, or, where `has_time` does not find the time in a line of it, with them as the first column,
/// called `t_s`. None if it is no such log.
pub(super) fn without(text: &str, has_time: impl Fn(&str) -> bool) -> Option<(String, &'static str)> {
    let lines = || text.lines().filter(|line| !line.trim().is_empty());
    let probed = lines().take(PROBE).count();
    let with = lines().take(PROBE).filter(|line| split(line).is_some()).count();
    if probed == 0 || (with as f64) < MIN_SHARE * probed as f64 {
        return None;
    }
    let rest = |line| split(line).map_or(line, |(_, rest)| rest);
    let keeps = !lines().take(PROBE).any(|line| has_time(rest(line)));
    let mut out = String::with_capacity(text.len());
    let mut is_head = true;
    for line in text.lines() {
        match split(line) {
            Some((time, rest)) if keeps && !rest.is_empty() => {
                let delimiter = delimiter(rest);
                // Names come first, and only once have to be told from counts.
                let is_names = is_head && rest.chars().filter(|c| c.is_alphabetic()).count() > 0;
                let first = if is_names { "t_s" } else { time };
                is_head = is_head && !is_names;
                let _ = write!(out, "{first}{delimiter}{rest}");
            }
            Some((_, rest)) => out.push_str(rest),
            None => out.push_str(line),
        }
        out.push('\n');
    }
    if !text.ends_with('\n') {
        out.pop();
    }
    let said = if keeps {
        "the lines begin with a serial monitor's time, which is taken as the time of the rows"
    } else {
        "the lines begin with a serial monitor's time, which is left out: the rows have their own"
    };
    Some((out, said))
}

/// The text without the brackets around each row, as `print` writes lists and tuples. None if the rows have none.
pub(super) fn unwrapped(text: &str) -> Option<String> {
    let inner = |line: &str| -> Option<String> {
        let line = line.trim().trim_end_matches(',');
        let inner = line.strip_prefix('[').and_then(|line| line.strip_suffix(']'));
        let inner = inner.or_else(|| line.strip_prefix('(').and_then(|line| line.strip_suffix(')')))?;
        (!inner.contains(['[', '('])).then(|| inner.to_owned())
    };
    let lines = || text.lines().filter(|line| !line.trim().is_empty()).take(PROBE);
    let with = lines().filter(|line| inner(line).is_some()).count();
    if with == 0 || (with as f64) < MIN_SHARE * lines().count() as f64 {
        return None;
    }
    Some(text.lines().map(|line| inner(line).unwrap_or_else(|| line.to_owned()) + "\n").collect())
}

/// A table of rows whose cells have labels, as for a serial plotter: `t:0.1,left:5,s0:1.2`. It has a
/// line of names more than the text. None if the rows are others.
pub(super) fn labelled(text: &str) -> Option<String> {
    let first = text.lines().find(|line| !line.trim().is_empty())?;
    let names = cells(first)?.into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    if names.len() < MIN_LABELS {
        return None;
    }
    let mut out = names.join(",");
    out.push('\n');
    let mut is_any = false;
    for line in text.lines() {
        match cells(line) {
            Some(cells) if cells.iter().map(|(name, _)| *name).eq(names.iter().copied()) => {
                is_any = true;
                out += &cells.iter().map(|(_, value)| *value).collect::<Vec<_>>().join(",");
            }
            _ => out.push_str(line),
        }
        out.push('\n');
    }
    is_any.then_some(out)
}

/// Fewer labels are no row of a drive.
const MIN_LABELS: usize = 3;

/// The labels and values of a line, if all its cells have both.
fn cells(line: &str) -> Option<Vec<(&str, &str)>> {
    let delimiter = delimiter(line);
    let fields =
        line.trim().trim_end_matches(delimiter).split(delimiter).map(str::trim).filter(|field| !field.is_empty());
    let cell = |field: &'_ str| -> Option<usize> {
        let at = field.find([':', '='])?;
        let label = field.get(..at)?.trim();
        let is_label = label.chars().any(char::is_alphabetic) && !label.contains('"');
        is_label.then_some(at)
    };
    fields
        .map(|field| {
            let at = cell(field)?;
            Some((field.get(..at)?.trim(), field.get(at + 1..)?.trim()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_a_serial_monitor_are_left_out_or_used() {
        let text = "12:00:01.123 -> millis,l,r\n12:00:01.223 -> 5,0,0\n";
        let (out, said) = without(text, |line| line.contains("millis")).unwrap();
        assert_eq!(out, "millis,l,r\n5,0,0\n");
        assert!(said.ends_with("left out: the rows have their own"));
        let text = "12:00:01.123 -> l,r\n12:00:01.223 -> 0,0";
        let (out, said) = without(text, |_| false).unwrap();
        assert_eq!(out, "t_s,l,r\n12:00:01.223,0,0");
        assert!(said.ends_with("the time of the rows"));
        assert!(without("t_s,l,r\n0,0,0\n", |_| true).is_none());
        assert!(without("", |_| true).is_none());
    }

    #[test]
    fn labels_become_the_header() {
        let expected = "t,L,R,S0\n0.1,5,6,1.2\n0.2,7,8,inf\n";
        for text in [
            "t:0.1,L:5,R:6,S0:1.2\nt:0.2,L:7,R:8,S0:inf\n",
            "t=0.1 L=5 R=6 S0=1.2\nt=0.2 L=7 R=8 S0=inf\n",
            "t: 0.1\tL: 5\tR: 6\tS0: 1.2\nt: 0.2\tL: 7\tR: 8\tS0: inf\n",
        ] {
            assert_eq!(labelled(text).as_deref(), Some(expected), "{text:?}");
        }
        for text in ["t_s,l,r\n1,2,3\n", "12:00:01,5,6\n", "", "a:1,b:2\n"] {
            assert_eq!(labelled(text), None, "{text:?}");
        }
    }

    #[test]
    fn brackets_around_rows_are_left_out() {
        assert_eq!(unwrapped("[0.1, 5, 6]\n(0.2, 7, 8)").as_deref(), Some("0.1, 5, 6\n0.2, 7, 8\n"));
        assert_eq!((unwrapped("t_s,l\n[1],2\n"), unwrapped("[[1, 2]]\n")), (None, None));
    }
}
