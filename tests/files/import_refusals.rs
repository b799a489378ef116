//! `slamd import` refuses what it cannot decide: exit code and sentence, and no capture.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

const ROBOT: &str = "[robot]\nwheel_radius_m = 0.035\nwheel_base_m = 0.26\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 4\nradius_m = 0.15\nhalf_angle_deg = 12.5\n";
const HEADER: &str = "t_s,left_ticks,right_ticks,r0,r1,r2,r3\n";

/// A folder with the robot's configuration.
fn folder_of_robot() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("robot.toml"), ROBOT).unwrap();
    folder
}

/// A straight drive at 0.23 m/s; the ticks are as `ticks` writes them.
fn drive(range_m: f64, ticks: impl Fn(i64) -> String) -> String {
    (0..200u32).fold(String::new(), |mut rows, k| {
        let count = ticks(i64::from(k) * 150);
        let range_m = range_m + 0.001 * f64::from(k);
        let ranges = format!(",{range_m:.3}").repeat(4);
        writeln!(rows, "{:.1},{count},{count}{ranges}", 0.1 * f64::from(k)).unwrap();
        rows
    })
}

/// Exit code and standard error of an import; `input` is written to its standard input until it reads no more.
fn import(folder: &Path, arguments: &[&str], input: &[u8]) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("import").args(arguments).args(["--config", "robot.toml", "--capture", "c.mcap"]).current_dir(folder);
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    while !input.is_empty() && pipe.write_all(input).is_ok() {}
    drop(pipe);
    let output = child.wait_with_output().unwrap();
    let (code, text) = (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(folder.join("c.mcap").exists(), code == 0, "{code} {text}");
    (code, text)
}

#[test]
fn what_cannot_be_decided_is_refused_with_its_reason() {
    let folder = folder_of_robot();
    let folder = folder.path();
    let plain = |count: i64| count.to_string();
    let grouped = |count: i64| match count {
        0..1000 => count.to_string(),
        _ => format!("\"{},{:03}\"", count / 1000, count % 1000),
    };
    let still =
        drive(1.0, plain).lines().fold(String::new(), |rows, row| rows + "0," + row.split_once(',').unwrap().1 + "\n");
    for (name, rows) in [
        ("two.csv", drive(1.0, plain) + &drive(2.0, plain)),
        ("one.csv", drive(1.0, plain)),
        ("still.csv", still),
        ("grouped.csv", drive(1.0, grouped)),
        ("bytes.csv", drive(1.0, |count| count.rem_euclid(256).to_string())),
    ] {
        std::fs::write(folder.join(name), HEADER.to_owned() + &rows).unwrap();
    }
    std::fs::write(folder.join("empty.mcap"), "").unwrap();
    let refusals: [(&[&str], i32, &str); 10] = [
        (
            &["ring", "two.csv", "--run", "3"],
            65,
            "two.csv: --run 3: the recording has 2 runs; after the first they begin in line 202",
        ),
        (
            &["ring", "one.csv", "--time-unit", "ms"],
            65,
            "one.csv: line 3: with --time-unit ms rows are 0.1 ms apart: are the stamps in seconds? --time-unit s",
        ),
        (&["ring", "still.csv"], 65, "still.csv: line 2: all 200 rows have the stamp 0"),
        (
            &["ring", "grouped.csv"],
            65,
            "grouped.csv: line 9, column 2: `1,050`: expected a number of encoder ticks without thousands separators",
        ),
        (&["ring", "bytes.csv"], 65, "bytes.csv: the ticks are those of counters of 8 bits"),
        (&["ring", "/dev/zero"], 74, "/dev/zero: it is a device, not a file"),
        (&["bag", "/dev/zero"], 74, "/dev/zero: it is a device, not a file"),
        (&["bag", "empty.mcap"], 65, "empty.mcap is empty"),
        (&["bag", "empty.mcap", "--no-echo", "NULL"], 64, "--no-echo NULL: only the cells of a ring CSV may be texts"),
        (&["ring", "one.csv", "--columns", "t_s,r0,r0"], 64, "the column \"r0\" is named twice"),
    ];
    for (arguments, expected, words) in refusals {
        let (code, text) = import(folder, arguments, b"");
        assert!(code == expected && text.contains(words), "{arguments:?}: {code} {text}");
    }
    let (code, text) = import(folder, &["ring", "-"], "1,2,3\n".repeat(10_000).as_bytes());
    assert!(code == 65 && text.contains("-: more than 256 MiB of text: split the recording"), "{code} {text}");
    let (code, text) = import(folder, &["ring", "two.csv", "--run", "2", "--no-echo", "NULL"], b"");
    assert!(code == 0 && text.contains("run 2 of 2 is imported"), "{code} {text}");
}

/// A drive of so many sensors, its cells as `cell` writes them and its times as `time` does.
fn table(sensors: u32, time: impl Fn(u32) -> String, cell: impl Fn(f64) -> String) -> String {
    let names: Vec<String> = (0..sensors).map(|sensor| format!("r{sensor}")).collect();
    let header = format!("t_s,left_ticks,right_ticks,{}\n", names.join(","));
    (0..120u32).fold(header, |mut rows, k| {
        let ranges: Vec<String> =
            (0..sensors).map(|sensor| cell(0.6 + 0.1 * f64::from(sensor) + 0.002 * f64::from(k))).collect();
        writeln!(rows, "{},{1},{1},{2}", time(k), 10 * k, ranges.join(",")).unwrap();
        rows
    })
}

/// A line of a CARMEN log of the same drive.
fn sonar(row: u32, ranges: &str) -> String {
    let t_s = 0.1 * f64::from(row);
    format!("SONAR 4 {ranges} 0 0 0 {x:.2} 0 0 {t_s} h {t_s}\n", x = 0.02 * f64::from(row))
}

fn tenths(k: u32) -> String {
    format!("{:.1}", 0.1 * f64::from(k))
}

fn metres(range_m: f64) -> String {
    format!("{range_m:.3}")
}

#[test]
fn each_mistake_is_named_with_what_to_do() {
    let folder = folder_of_robot();
    let folder = folder.path();
    let plain = table(4, tenths, metres);
    let log: String = (0..50).map(|row| sonar(row, "1.2 1.2 1.2 1.2")).collect();
    let dates = table(4, |k| format!("07/04/2024 12:00:{:04.1}", 0.1 * f64::from(k)), metres);
    let commas = table(4, |k| tenths(k).replace('.', ","), |range_m| metres(range_m).replace('.', ","));
    for (name, text) in [
        ("plain.csv", plain.as_str()),
        ("commas.csv", &commas),
        ("dates.csv", &dates),
        ("eight.csv", &table(8, tenths, metres)),
        ("sonar.log", &log),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let refusals: [(&[&str], &str); 7] = [
        (&["ring", "commas.csv"], "commas are decimal signs here, too: export with decimal points, or with ;"),
        (&["ring", "dates.csv"], "a date that begins with its year: of 07/04/2024 nobody knows"),
        (&["ring", "eight.csv"], "the header has 8 sensors (r0 to r7), the configured ring has 4"),
        (&["ring", "plain.csv", "--range-unit", "cm"], "metres? --range-unit m"),
        (&["ring", "sonar.log"], "sonar.log is a CARMEN log; `slamd import carmen` reads it"),
        (&["carmen", "plain.csv"], "plain.csv is no CARMEN log but a table; `slamd import ring` reads CSV"),
        (&["carmen", "sonar.log", "--scan", "flaser"], "the log has no FLASER line, but 50 SONAR lines (--scan sonar)"),
    ];
    for (arguments, words) in refusals {
        let (code, text) = import(folder, arguments, b"");
        assert!(code == 65 && text.contains(words), "{arguments:?}: {code} {text}");
    }
    for arguments in [["replay", "plain.csv"].as_slice(), &["doctor", "--capture", "plain.csv"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        let output = command.args(arguments).current_dir(folder).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains("it is a text: `slamd import ring` makes a capture of a CSV"), "{arguments:?}: {text}");
    }
}

#[test]
fn damaged_lines_cost_no_more_than_themselves() {
    let folder = folder_of_robot();
    let folder = folder.path();
    let plain = table(4, tenths, metres);
    let damaged = |line: usize, text: &str| -> String {
        plain.lines().enumerate().map(|(at, row)| format!("{}\n", if at + 1 == line { text } else { row })).collect()
    };
    for (text, words) in [
        (
            damaged(40, "3.8,380,380,0.6#8,0.7,0.8,0.9"),
            "1 broken row is left out (line 40): line 40, column 4: `0.6#8`",
        ),
        (damaged(40, "3.8,380"), "1 broken row is left out (line 40)"),
        (
            damaged(40, "ets Jun  8 2016 00:22:57\nrst:0x1"),
            "2 lines are no rows and left out; the first is line 40: `ets",
        ),
        (plain.replacen("right_ticks", "right\0_ticks", 1), "1 zero byte is left out, the first in line 1"),
        (plain.trim_end_matches("38\n").to_owned(), "its last value is shorter than the others: it is cut off"),
    ] {
        std::fs::write(folder.join("drive.csv"), text).unwrap();
        let (code, said) = import(folder, &["ring", "drive.csv", "--force"], b"");
        assert!(code == 0 && said.contains(words), "{words}: {code} {said}");
        std::fs::remove_file(folder.join("c.mcap")).unwrap();
    }
    let third: String =
        plain.lines().enumerate().map(|(at, row)| format!("{row}{}\n", if at % 3 == 2 { "#" } else { "" })).collect();
    std::fs::write(folder.join("drive.csv"), third).unwrap();
    let (code, said) = import(folder, &["ring", "drive.csv"], b"");
    assert!(code == 65 && said.contains("40 of 120 rows cannot be read, more than 10 %"), "{code} {said}");
    let ranges = |row: u32| if row == 20 { "1.2 1.2 x 1.2" } else { "1.2 1.2 1.2 1.2" };
    let text: String = (0..50).map(|row| sonar(row, ranges(row))).collect();
    std::fs::write(folder.join("drive.log"), text).unwrap();
    let (code, said) = import(folder, &["carmen", "drive.log"], b"");
    assert!(code == 0 && said.contains("1 broken row is left out (line 21)"), "{code} {said}");
}

#[test]
fn units_that_change_are_named() {
    let folder = folder_of_robot();
    let folder = folder.path();
    let plain = table(4, tenths, metres);
    let scaled = |row: &str, from: usize| -> String {
        let cells = row.split(',').enumerate().map(|(column, cell)| match cell.parse::<f64>() {
            Ok(value) if column >= from => format!("{:.1}", 100.0 * value),
            _ => cell.to_owned(),
        });
        cells.collect::<Vec<_>>().join(",")
    };
    let one: String = plain.lines().map(|row| scaled(row, 6) + "\n").collect();
    std::fs::write(folder.join("one.csv"), one).unwrap();
    let (code, said) = import(folder, &["ring", "one.csv"], b"");
    assert!(code == 0 && said.contains("sensor 3 reads about 100 times the others"), "{code} {said}");
    std::fs::remove_file(folder.join("c.mcap")).unwrap();
    let late: String = plain
        .lines()
        .enumerate()
        .map(|(at, row)| if at < 71 { row.to_owned() + "\n" } else { scaled(row, 3) + "\n" })
        .collect();
    std::fs::write(folder.join("late.csv"), late).unwrap();
    let (code, said) = import(folder, &["ring", "late.csv"], b"");
    assert!(code == 65 && said.contains("line 72: from here on the ranges are about 100 times"), "{code} {said}");
}

#[test]
fn an_imported_recording_gets_no_advice_about_its_boards_clock() {
    let folder = folder_of_robot();
    let folder = folder.path();
    std::fs::write(folder.join("drive.csv"), table(4, tenths, metres)).unwrap();
    assert_eq!(import(folder, &["ring", "drive.csv"], b"").0, 0);
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    let output = command.args(["doctor", "--capture", "c.mcap"]).current_dir(folder).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("4 of 4 sensors measure") && !text.contains("time requests"), "{text}");
    for live in ["reset button", "--seconds", "flash", "while this runs"] {
        assert!(!text.contains(live), "{live}: {text}");
    }
}
