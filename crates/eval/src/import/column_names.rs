//! What the name of a column may mean, such as `encL`, `sonar_3_cm` or `Time [ms]`.

use super::columns::Role;
use super::ranges::RangeUnit;
use super::times::TimeUnit;

const TIME: &[&str] =
    &["t", "ts", "time", "timestamp", "stamp", "elapsed", "clock", "uptime", "datetime", "date", "epoch", "zeit"];
const TIME_UNITS: &[(&str, TimeUnit)] = &[
    ("s", TimeUnit::Seconds),
    ("sec", TimeUnit::Seconds),
    ("secs", TimeUnit::Seconds),
    ("seconds", TimeUnit::Seconds),
    ("ms", TimeUnit::Milliseconds),
    ("msec", TimeUnit::Milliseconds),
    ("millis", TimeUnit::Milliseconds),
    ("milliseconds", TimeUnit::Milliseconds),
    ("us", TimeUnit::Microseconds),
    ("usec", TimeUnit::Microseconds),
    ("micros", TimeUnit::Microseconds),
    ("microseconds", TimeUnit::Microseconds),
    ("ns", TimeUnit::Nanoseconds),
    ("nanos", TimeUnit::Nanoseconds),
    ("nanoseconds", TimeUnit::Nanoseconds),
];
const SIDES: &[(&str, usize)] = &[("l", 0), ("left", 0), ("lft", 0), ("r", 1), ("right", 1), ("rgt", 1)];
const ENCODERS: &[&str] = &[
    "enc", "encoder", "encoders", "tick", "ticks", "count", "counts", "cnt", "wheel", "pulse", "pulses", "pos",
    "position", "odo", "odom", "steps", "motor",
];
const RANGES: &[&str] = &[
    "r",
    "range",
    "ranges",
    "rng",
    "d",
    "dist",
    "distance",
    "sonar",
    "us",
    "ultrasonic",
    "ultrasound",
    "ultra",
    "sensor",
    "sens",
    "s",
    "u",
    "echo",
    "pulse",
    "ping",
    "hc",
    "sr",
    "hcsr",
    "srf",
];
const RANGE_UNITS: &[(&str, RangeUnit)] = &[
    ("m", RangeUnit::Metres),
    ("ft", RangeUnit::Feet),
    ("dm", RangeUnit::Decimetres),
    ("in", RangeUnit::Inches),
    ("inch", RangeUnit::Inches),
    ("cm", RangeUnit::Centimetres),
    ("mm", RangeUnit::Millimetres),
];
/// Words that say nothing.
const PLAIN: &[&str] = &["value", "val", "raw", "reading", "total", "sum", "since", "boot", "start", "of", "the"];
/// Directions of sensors: beside them `left` is no encoder.
pub(super) const DIRECTIONS: &[&str] = &["front", "back", "rear", "centre", "center", "middle", "ahead"];

fn find<T: Copy>(table: &[(&str, T)], word: &str) -> Option<T> {
    table.iter().find(|(name, _)| *name == word).map(|(_, value)| *value)
}

fn is_word(word: &str) -> bool {
    [TIME, ENCODERS, RANGES, PLAIN].iter().any(|list| list.contains(&word))
        || find(TIME_UNITS, word).is_some()
        || find(SIDES, word).is_some()
        || find(RANGE_UNITS, word).is_some()
}

/// The words of letters that are written together: `encl` is `enc` and `l`. None if they are others. Single letters join longer words only.
fn words_of(letters: &str, out: &mut Vec<String>) -> bool {
    if is_word(letters) {
        out.push(letters.to_owned());
        return true;
    }
    for at in (1..letters.len()).rev() {
        let Some((first, rest)) = letters.split_at_checked(at) else { continue };
        if is_word(first) && (first.len() > 1 || rest.len() > 1) {
            let before = out.len();
            out.push(first.to_owned());
            if out.len() <= MAX_WORDS && words_of(rest, out) {
                return true;
            }
            out.truncate(before);
        }
    }
    false
}

const MAX_WORDS: usize = 6;
/// Longer names are none.
const MAX_NAME: usize = 40;

/// The words and the last number of a column's name; none if it has a word of unknown meaning.
fn parts(name: &str) -> Option<(Vec<String>, Option<usize>)> {
    if name.len() > MAX_NAME {
        return None;
    }
    let (mut words, mut number, mut chunk) = (Vec::new(), None, String::new());
    let mut flush = |chunk: &mut String, number: &mut Option<usize>| {
        let text = std::mem::take(chunk).to_lowercase();
        match text.parse::<usize>() {
            _ if text.is_empty() => true,
            Ok(value) => {
                *number = Some(value);
                true
            }
            Err(_) => words_of(&text, &mut words),
        }
    };
    let mut before = ' ';
    for character in name.chars() {
        let is_border = (before.is_lowercase() && character.is_uppercase())
            || before.is_ascii_digit() != character.is_ascii_digit()
            || !character.is_alphanumeric();
        if is_border && !flush(&mut chunk, &mut number) {
            return None;
        }
        if character.is_alphanumeric() {
            chunk.push(character);
        }
        before = character;
    }
    flush(&mut chunk, &mut number).then_some((words, number))
}

/// What a column's name may mean.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Meaning {
    Time(Option<TimeUnit>),
    /// The encoder, and whether the name says that it is one.
    Ticks(usize, bool),
    /// The name without its number, the number, the unit.
    Range(String, Option<usize>, Option<RangeUnit>),
    Unknown,
}

pub(super) fn meaning(name: &str) -> Meaning {
    let Some((words, number)) = parts(name).filter(|(words, _)| !words.is_empty()) else { return Meaning::Unknown };
    let words: Vec<&str> = words.iter().map(String::as_str).filter(|word| !PLAIN.contains(word)).collect();
    let all = |test: &dyn Fn(&str) -> bool| words.iter().all(|word| test(word));
    let any = |list: &[&str]| words.iter().any(|word| list.contains(word));
    let unit = || words.iter().rev().find_map(|word| find(TIME_UNITS, word));
    if words.is_empty() {
        return Meaning::Unknown;
    }
    if number.is_none() && all(&|word| TIME.contains(&word) || find(TIME_UNITS, word).is_some()) {
        return Meaning::Time(unit());
    }
    let sides: Vec<usize> = words.iter().filter_map(|word| find(SIDES, word)).collect();
    if let ([side], None) = (sides.as_slice(), number)
        && all(&|word| ENCODERS.contains(&word) || find(SIDES, word).is_some())
    {
        return Meaning::Ticks(*side, any(ENCODERS));
    }
    if any(RANGES) && all(&|word| RANGES.contains(&word) || find(RANGE_UNITS, word).is_some()) {
        // Of `echo_us_3` and `us3` only the first is a time.
        let is_flight = words.contains(&"us") && any(&["echo", "pulse"]);
        let unit = words.iter().find_map(|word| find(RANGE_UNITS, word));
        let unit = if is_flight { Some(RangeUnit::Microseconds) } else { unit };
        return Meaning::Range(words.join("_"), number, unit);
    }
    Meaning::Unknown
}

/// The units in a row below the header, such as `ms,,,cm,cm`; none if it is no such row.
pub(super) fn units(fields: &[String], roles: &[Role]) -> Option<(Option<TimeUnit>, Option<RangeUnit>)> {
    let is_text = |field: &String| field.is_empty() || field.parse::<f64>().is_err();
    let unit = |role: Role| {
        let field = roles.iter().position(|other| *other == role).and_then(|column| fields.get(column))?;
        Some(field.trim_matches(['[', ']', '(', ')', ' ']).to_lowercase())
    };
    let time = unit(Role::Time).and_then(|word| find(TIME_UNITS, &word));
    let range = unit(Role::Range(0))
        .and_then(|word| find(RANGE_UNITS, &word).or_else(|| (word == "us").then_some(RangeUnit::Microseconds)));
    (fields.iter().all(is_text) && (time.is_some() || range.is_some())).then_some((time, range))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_are_written_together_are_taken_apart() {
        for (name, expected) in [
            ("encL", Meaning::Ticks(0, true)),
            ("rightticks", Meaning::Ticks(1, true)),
            ("left", Meaning::Ticks(0, false)),
            ("tms", Meaning::Time(Some(TimeUnit::Milliseconds))),
            ("us", Meaning::Time(Some(TimeUnit::Microseconds))),
            ("us0", Meaning::Range("us".into(), Some(0), None)),
            ("HC-SR04_2", Meaning::Range("hc_sr".into(), Some(2), None)),
        ] {
            assert_eq!(meaning(name), expected, "{name}");
        }
        for name in [
            "", "yaw", "battery", "temp", "id", "n", "seq", "dt", "speed_l", "status", "x", "theta", "vbat", "rssi",
            "12",
        ] {
            assert_eq!(meaning(name), Meaning::Unknown, "{name}");
        }
    }

    #[test]
    fn a_row_of_units_is_known() {
        let roles = [Role::Time, Role::Ticks(0), Role::Ticks(1), Role::Range(0)];
        let of = |row: &str| units(&row.split(',').map(str::to_owned).collect::<Vec<_>>(), &roles);
        assert_eq!(of("ms,-,-,cm"), Some((Some(TimeUnit::Milliseconds), Some(RangeUnit::Centimetres))));
        assert_eq!(of("[s],ticks,ticks,[m]"), Some((Some(TimeUnit::Seconds), Some(RangeUnit::Metres))));
        assert_eq!(of("0.1,0,0,1.2"), None);
        assert_eq!(of("boot,0,0,x"), None);
    }
}
