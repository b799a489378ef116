//! `slamd import` refuses what it cannot decide: exit code and sentence, and no capture.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

const ROBOT: &str = "[robot]\nwheel_radius_m = 0.035\nwheel_base_m = 0.26\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 4\nradius_m = 0.15\nhalf_angle_deg = 12.5\n";
const HEADER: &str = "t_s,left_ticks,right_ticks,r0,r1,r2,r3\n";

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
    let folder = tempfile::tempdir().unwrap();
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
    std::fs::write(folder.join("robot.toml"), ROBOT).unwrap();
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
