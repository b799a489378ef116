//! `slamd import ring` on tables as people write them: what is unambiguous gives the capture of the plain table, the rest is refused or asked about.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::f64::consts::TAU;
use std::path::Path;
use std::process::Command;

const ROBOT: &str = "[robot]\nwheel_radius_m = 0.035\nwheel_base_m = 0.26\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 4\nradius_m = 0.15\nhalf_angle_deg = 12.5\n";
const HEADER: &str = "t_s,left_ticks,right_ticks,r0,r1,r2,r3";
const ROWS: u32 = 200;

/// A cell of the plain table: tenths of a second, ticks, millimetres. Infinity is no echo.
#[derive(Clone, Copy)]
struct Row {
    tenths: u32,
    ticks: [i32; 2],
    ranges_mm: [f64; 4],
}

/// A drive along a curve. A sensor in turn hears nothing in every fifth row.
fn drive() -> Vec<Row> {
    let row = |k: u32| {
        let way = i32::try_from(k).unwrap();
        let range_mm = |sensor: u32| match (k % 5, k / 5 % 4 == sensor) {
            (0, true) => f64::INFINITY,
            _ => f64::from(450 + 300 * sensor + 5 * k),
        };
        Row { tenths: k, ticks: [150 * way, 143 * way], ranges_mm: [0, 1, 2, 3].map(range_mm) }
    };
    (0..ROWS).map(row).collect()
}

/// How a table is written.
struct Style {
    time: fn(u32) -> String,
    ticks: fn(i32) -> String,
    range: fn(f64) -> String,
}

const PLAIN: Style = Style {
    time: |tenths| format!("{:.1}", 0.1 * f64::from(tenths)),
    ticks: |ticks| ticks.to_string(),
    range: |mm| if mm.is_finite() { format!("{:.3}", 1e-3 * mm) } else { "inf".into() },
};

impl Style {
    fn rows(&self) -> Vec<String> {
        let row = |row: Row| {
            let cells = row.ticks.map(self.ticks).into_iter().chain(row.ranges_mm.map(self.range));
            std::iter::once((self.time)(row.tenths)).chain(cells).collect::<Vec<_>>().join(",")
        };
        drive().into_iter().map(row).collect()
    }

    fn table(&self, header: &str) -> String {
        [header.to_owned()].into_iter().chain(self.rows()).map(|line| line + "\n").collect()
    }
}

fn millis(tenths: u32) -> String {
    (100 * tenths).to_string()
}

/// Ranges in a unit of so many millimetres.
fn scaled(mm: f64, unit_mm: f64) -> String {
    if mm.is_finite() { format!("{:.9}", mm / unit_mm) } else { "inf".into() }
}

/// Exit code, standard error and the capture of the table `text`.
fn import(text: &str, options: &[&str]) -> (i32, String, Option<Vec<u8>>) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| -> std::path::PathBuf { Path::new(folder.path()).join(name) };
    std::fs::write(path("robot.toml"), ROBOT).unwrap();
    std::fs::write(path("drive.csv"), text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.args(["import", "ring", "drive.csv", "--config", "robot.toml", "--capture", "c.mcap"]).args(options);
    let output = command.current_dir(folder.path()).output().unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap(), std::fs::read(path("c.mcap")).ok())
}

/// Asserts that a table gives the capture of the plain one, and says this.
#[track_caller]
fn assert_plain(text: &str, options: &[&str], said: &str) {
    let plain = import(&PLAIN.table(HEADER), &[]);
    assert_eq!(plain.0, 0, "{}", plain.1);
    let (code, words, capture) = import(text, options);
    assert!(code == 0 && words.contains(said), "{said}: {code} {words}");
    assert!(capture == plain.2, "{said}: another capture than that of the plain table");
}

#[track_caller]
fn assert_refused(text: &str, options: &[&str], said: &str) {
    let (code, words, capture) = import(text, options);
    assert!(code == 65 && words.contains(said) && capture.is_none(), "{said}: {code} {words}");
}

#[test]
fn usual_names_of_columns_give_the_same_capture() {
    for (header, said) in [
        ("time,encL,encR,sonar_0,sonar_1,sonar_2,sonar_3", "taken as --columns t_s,left_ticks,right_ticks,r0-r3\n"),
        ("t,left,right,d0,d1,d2,d3", "taken as --columns t_s,left_ticks,right_ticks,r0-r3\n"),
        ("Time [s],Left Encoder,Right Encoder,S1,S2,S3,S4", "taken as --columns t_s,left_ticks,right_ticks,r0-r3\n"),
    ] {
        assert_plain(&PLAIN.table(header), &[], said);
    }
    let in_ms = Style { time: millis, ..PLAIN };
    for (header, said) in [
        ("millis,ticks_l,ticks_r,us0,us1,us2,us3", "r0-r3 --time-unit ms\n"),
        ("t_ms,enc_left,enc_right,dist1,dist2,dist3,dist4", "r0-r3 --time-unit ms\n"),
    ] {
        assert_plain(&in_ms.table(header), &[], said);
    }
    let in_cm = Style { range: |mm| scaled(mm, 10.0), ..in_ms };
    let header = "timestamp_ms,left_ticks,right_ticks,range_0_cm,range_1_cm,range_2_cm,range_3_cm";
    assert_plain(&in_cm.table(header), &[], "r0-r3 --time-unit ms --range-unit cm\n");
    let more: String =
        PLAIN.table(HEADER).lines().enumerate().map(|(k, line)| more(k, line, "seq", "battery")).collect();
    assert_plain(&more, &[], "line 1: the columns are found by their names; not used: seq, battery\n");
}

/// A line with a column before and one behind.
fn more(index: usize, line: &str, before: &str, behind: &str) -> String {
    if index == 0 { format!("{before},{line},{behind}\n") } else { format!("{index},{line},7.{index}\n") }
}

#[test]
fn unclear_names_are_refused_with_the_option_to_type() {
    let numbered = PLAIN.table("t,enc1,enc2,d0,d1,d2,d3");
    let option = "t_s,left_ticks,right_ticks,r0-r3";
    for text in [&numbered, &PLAIN.table("zeit,links,rechts,a,b,c,d"), &PLAIN.table(HEADER)[HEADER.len() + 1..]] {
        assert_refused(text, &[], &format!("if its columns are in this order, type --columns {option}"));
        assert_plain(text, &["--columns", option], "");
    }
    assert_refused(&PLAIN.table("time,millis,encR,d0,d1,d2,d3"), &[], "both `time` and `millis` may be the time");
    assert_refused(
        &PLAIN.table("t_s,left_ticks,right_ticks,d0,d1,d2,x"),
        &[],
        "the header has 3 ranges (`d0` to `d2`), the configured ring has 4 sensors",
    );
}

#[test]
fn logs_of_monitors_and_prints_of_programs_give_the_same_capture() {
    let rows = PLAIN.rows();
    let monitor: String = std::iter::once(HEADER.to_owned())
        .chain(rows.clone())
        .enumerate()
        .map(|(k, line)| format!("12:{:02}:{:02}.{:03} -> {line}\n", k / 600, k / 10 % 60, k % 10 * 100))
        .collect();
    assert_plain(&monitor, &[], "a serial monitor's time, which is left out: the rows have their own");
    let labelled = |row: &String| {
        let cells = HEADER.split(',').zip(row.split(',')).map(|(name, cell)| format!("{name}:{cell}"));
        cells.collect::<Vec<_>>().join("\t") + "\n"
    };
    assert_plain(&rows.iter().map(labelled).collect::<String>(), &[], "the cells have labels");
    let lists: String = rows.iter().map(|row| format!("[{}]\n", row.replace(',', ", "))).collect();
    let columns = ["--columns", "t_s,left_ticks,right_ticks,r0-r3"];
    assert_plain(&lists, &columns, "the brackets around each row are left out");
    let notes = PLAIN
        .table(HEADER)
        .replacen(HEADER, &format!("// my robot, v2\n{HEADER}"), 1)
        .replace("\n1.0,", "\n// on\n1.0,");
    assert_plain(&notes, &[], "");
    let units = Style { time: millis, range: |mm| scaled(mm, 10.0), ..PLAIN };
    let units = units.table(&format!("{HEADER}\nms,ticks,ticks,cm,cm,cm,cm"));
    assert_plain(&units, &[], "line 2: a row of units, taken as --time-unit ms --range-unit cm");
    assert_refused("{\"t_s\": 0.1, \"r0\": 1.5}\n", &[], "drive.csv is a file of JSON; write a table");
}

#[test]
fn cells_with_units_and_hexadecimal_ticks_give_the_same_capture() {
    let with_unit = |mm: f64| if mm.is_finite() { format!("{:.1} cm", 0.1 * mm) } else { "inf".into() };
    let text = Style { range: with_unit, ..PLAIN }.table(HEADER);
    assert_plain(&text, &[], "`75.0 cm`: ranges are read in the unit that stands with them");
    let text = Style { ticks: |ticks| format!("0x{ticks:X}"), ..PLAIN }.table(HEADER);
    assert_plain(&text, &[], "line 2: `0x0`: ticks are read as hexadecimal numbers");
}

#[test]
fn ticks_in_metres_are_refused_and_read_as_told() {
    fn metres(ticks: i32) -> String {
        format!("{:.6}", f64::from(ticks) * TAU * 0.035 / 1440.0)
    }
    let text = Style { ticks: metres, ..PLAIN }.table(HEADER);
    assert_refused(&text, &[], "have fractions such as 0.0229");
    assert_refused(&text, &[], "--ticks metres, turns, radians or degrees");
    assert_plain(&text, &["--ticks", "metres"], "");
    let text = Style { ticks: |ticks| format!("{:.6}", f64::from(ticks) / 1440.0), ..PLAIN }.table(HEADER);
    assert_refused(&text, &[], "have fractions such as 0.104167");
    assert_plain(&text, &["--ticks", "turns"], "");
    let text = Style { ticks: |ticks| format!("{:.3}", f64::from(ticks) / 4.0), ..PLAIN }.table(HEADER);
    assert_plain(&text, &["--ticks", "degrees"], "");
    let (code, said, _) = import(&text, &[]);
    assert!(code == 0 && said.contains("fractions such as 37.5, taken as counts of which 1440 are a turn"), "{said}");
}

#[test]
fn encoders_without_a_count_are_named() {
    let without = |wheel: usize, to: &str| -> String {
        let cut = |row: String| {
            let cells = row.split(',').enumerate().map(|(column, cell)| if column == wheel { to } else { cell });
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        std::iter::once(format!("{HEADER}\n")).chain(PLAIN.rows().into_iter().map(cut)).collect()
    };
    let (code, said, _) = import(&without(1, ""), &[]);
    assert!(
        code == 0 && said.contains("column 2, `left_ticks` is empty in all 200 rows, taken as an encoder"),
        "{said}"
    );
    let (code, said, _) = import(&without(2, ""), &[]);
    assert!(code == 0 && said.contains("leave the column out: --columns t_s,left_ticks,-,r0-r3"), "{said}");
    let (code, said, _) = import(&without(2, ""), &["--columns", "t_s,left_ticks,-,r0-r3"]);
    assert_eq!(code, 0, "{said}");
    let (code, said, _) = import(&without(1, "5"), &[]);
    assert!(
        code == 0 && said.contains("column 2, `left_ticks`, is 5 in all rows while the other wheel rolls"),
        "{said}"
    );
}

#[test]
fn feet_are_refused_and_read_as_told() {
    let text = Style { range: |mm| scaled(mm, 304.8), ..PLAIN }.table(HEADER);
    assert_refused(&text, &[], "feet? --range-unit ft; where they are metres: --range-unit m");
    assert_plain(&text, &["--range-unit", "ft"], "");
}

#[test]
fn values_that_may_mean_no_echo_are_asked_about_and_read_as_told() {
    for (word, said) in [
        (
            "2.203",
            "are 2.203, many more than of any value near it, and are taken as ranges; where 2.203 means no echo: --no-echo 2.203",
        ),
        ("", "are empty or nan, taken as no measurement; where they mean no echo: --no-echo empty"),
        ("nan", "are empty or nan, taken as no measurement; where they mean no echo: --no-echo empty --no-echo nan"),
    ] {
        let text = PLAIN.table(HEADER).replace("inf", word);
        let (code, words, _) = import(&text, &[]);
        assert!(code == 0 && words.contains(said), "{word}: {code} {words}");
        assert_plain(&text, &["--no-echo", if word.is_empty() { "empty" } else { word }], "");
    }
    for word in ["OUT OF RANGE", ">3.0", "-inf"] {
        let text = PLAIN.table(HEADER).replace("inf", word);
        assert_refused(&text, &[], "where it means no echo: --no-echo");
        assert_plain(&text, &[&format!("--no-echo={word}")], "");
    }
}

#[test]
fn rows_out_of_order_are_named_as_what_they_are() {
    let rows = PLAIN.rows();
    let table = |rows: Vec<String>| -> String {
        std::iter::once(HEADER.to_owned()).chain(rows).map(|line| line + "\n").collect()
    };
    let reversed = table(rows.iter().rev().cloned().collect());
    assert_refused(
        &reversed,
        &[],
        "the times run backwards, from 19.9 in line 2 to 0 in line 201: the rows are in reverse",
    );
    let shuffled = table((0..rows.len()).map(|k| rows[k * 77 % rows.len()].clone()).collect());
    assert_refused(
        &shuffled,
        &[],
        "rows have an earlier time than the row before: the rows are not in the order of their",
    );
    let milliseconds = Style { time: millis, ..PLAIN }.rows();
    let shuffled = table((0..rows.len()).map(|k| milliseconds[k * 77 % rows.len()].clone()).collect());
    assert_refused(&shuffled, &["--time-unit", "ms"], "the rows are not in the order of their times; sort them");
}

#[test]
fn clocks_and_counts_are_called_what_they_are() {
    // millis() wraps 10 s after the begin.
    let wrapped = |tenths: u32| (100 * tenths).wrapping_sub(10_000).to_string();
    let text = Style { time: wrapped, ..PLAIN }.table(&HEADER.replace("t_s", "millis"));
    let (code, said, _) = import(&text, &[]);
    assert!(code == 0 && said.contains("line 102: millis() wraps after 2^32 ms (49.7 days); the rows"), "{said}");
    let text = Style { time: |tenths| format!("12:00:{:04.1}", 0.1 * f64::from(tenths)), ..PLAIN }.table(HEADER);
    assert_plain(&text, &[], "the stamps are times of day\n");
    let one: String = PLAIN.table(HEADER).lines().take(2).map(|line| format!("{line}\n")).collect();
    let (code, said, _) = import(&one, &[]);
    assert!(code == 0 && said.contains("c.mcap: 1 row of ranges over 0.0 s"), "{said}");
    let text = Style { time: |tenths| tenths.to_string(), ..PLAIN }.table(HEADER);
    let (code, said, _) = import(&text, &[]);
    assert!(code == 0 && said.contains("if they number the rows, export the time of each row"), "{said}");
}
