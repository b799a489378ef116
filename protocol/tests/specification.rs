//! The tables of README.md match the code.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_protocol::{MAX_ECHOES, MAX_PLACEMENTS, MAX_SENSORS, Setting, VERSION_MAJOR, VERSION_MINOR, kind};

const SPECIFICATION: &str = include_str!("../README.md");

/// The cells of each row with a first cell that satisfies `is_key`.
fn rows(is_key: impl Fn(&str) -> bool) -> Vec<Vec<&'static str>> {
    let cells = |line: &'static str| line.trim_matches('|').split('|').map(str::trim).collect::<Vec<_>>();
    SPECIFICATION.lines().filter(|line| line.starts_with('|')).map(cells).filter(|cells| is_key(cells[0])).collect()
}

#[test]
fn settings_are_those_of_the_code() {
    let written = rows(|key| key.parse::<u8>().is_ok());
    assert_eq!(written.len(), Setting::ALL.len());
    for (row, setting) in written.iter().zip(Setting::ALL) {
        let (least, most) = setting.range().into_inner();
        let while_firing = if setting.needs_stop() { "no" } else { "yes" };
        let expected = [
            setting.key().to_string(),
            format!("`{}`", setting.name()),
            format!("{least} to {most}"),
            setting.default().to_string(),
            while_firing.into(),
        ];
        assert_eq!(row, &expected);
    }
}

#[test]
fn messages_are_those_of_the_code() {
    let written = rows(|kind| kind.starts_with("0x") && kind.len() == 4);
    let written: Vec<(u8, &str)> =
        written.iter().map(|row| (u8::from_str_radix(&row[0][2..], 16).unwrap(), row[1])).collect();
    let known: Vec<(u8, &str)> = (0..=u8::MAX).filter_map(|code| Some((code, kind::name(code)?))).collect();
    assert_eq!(written, known);
}

/// The numbers right after each `before`.
fn numbers(before: &str) -> Vec<usize> {
    let number = |rest: &str| rest.split(|c: char| !c.is_ascii_digit()).next().and_then(|digits| digits.parse().ok());
    SPECIFICATION.split(before).skip(1).filter_map(number).collect()
}

#[test]
fn limits_and_the_version_are_those_of_the_code() {
    let one_line = SPECIFICATION.replace('\n', " ");
    assert!(one_line.contains(&format!("specification of version {VERSION_MAJOR}.{VERSION_MINOR}.")));
    assert!(one_line.contains(&format!("| version of the protocol: {VERSION_MAJOR}, {VERSION_MINOR} |")));
    assert!(one_line.contains(&format!("A ring has 1 to {MAX_SENSORS} sensors.")));
    assert!(one_line.contains(&format!("| sensors of the ring, 1 to {MAX_SENSORS} |")));
    assert_eq!(usize::try_from(*Setting::Sensors.range().end()), Ok(MAX_SENSORS));
    // "at most 26 in one message", "at most 64" echoes, "at most 64 sensors".
    let most: Vec<usize> = numbers("at most ").into_iter().filter(|number| (16..=255).contains(number)).collect();
    assert_eq!(most, [MAX_PLACEMENTS, MAX_ECHOES, MAX_SENSORS]);
    assert_eq!(u64::BITS as usize, MAX_SENSORS, "each sensor has its bit in stuck_mask");
}
