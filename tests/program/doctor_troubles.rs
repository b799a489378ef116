//! `slamd doctor` on boards with the mistakes of firmware that others wrote: each is named, none is taken for another.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::doctor::{Examination, Finding, Level, Report};
use slamd_capture::{CaptureInfo, CaptureWriter, Record};
use slamd_core::{Config, Timestamp};
use slamd_protocol::{FrameEncoder, Message};
use slamd_testkit::odd_board::{OddBoard, Oddity};

fn examine(oddity: Oddity, seconds: u64) -> Report {
    let mut examination = Examination::new(&Config::default(), 115_200, "test");
    OddBoard::new(oddity).run(seconds, |now_us, said| {
        let now = Timestamp::from_us(now_us);
        if !said.is_empty() {
            examination.received(now, said);
        }
        examination.run_until(now);
        let frames = examination.take_transmit();
        for frame in &frames {
            examination.sent(now, frame);
        }
        frames.concat()
    });
    examination.report()
}

/// The findings that say something is wrong with the board. Its echoes belong to no room, so what the walls say of the robot is left out.
fn wrong(report: &Report) -> Vec<&Finding> {
    let is_wrong = |finding: &&Finding| finding.level >= Level::Warning && finding.id != "model.differs";
    report.findings.iter().filter(is_wrong).collect()
}

/// This finding with these words and remedy, and no other warning or problem but those in `also`.
#[track_caller]
fn assert_only(report: &Report, id: &str, [text, fix]: [&str; 2], also: &[&str]) {
    let wrong = wrong(report);
    let found = wrong.iter().find(|finding| finding.id == id).unwrap_or_else(|| panic!("no {id} in:\n{report}"));
    assert!(found.text.contains(text) && found.fix.as_ref().unwrap().contains(fix), "{found}");
    let others = wrong.iter().filter(|finding| finding.id != id && !also.contains(&finding.id)).count();
    assert_eq!(others, 0, "\n{report}");
}

#[test]
fn a_board_without_mistakes_has_no_finding() {
    let report = examine(Oddity::None, 20);
    assert_eq!(wrong(&report).len(), 0, "\n{report}");
}

#[test]
fn counts_that_no_wheel_can_make_are_named_and_left_out() {
    let path = |report: &Report| {
        let ahead = report.findings.iter().find(|finding| finding.id == "wheels.ahead").unwrap();
        ahead.text.rsplit(' ').nth(1).unwrap().parse::<f64>().unwrap()
    };
    // 38 s at 0.3 m/s.
    let report = examine(Oddity::Wraps, 40);
    assert_only(&report, "wheels.counts", ["wraps at 16 bits", "32 bits"], &[]);
    assert!((path(&report) - 11.4).abs() < 0.15, "\n{report}");
    let report = examine(Oddity::StartsAnew, 20);
    assert_only(&report, "wheels.counts", ["the counters start anew", "resets the encoders' counters"], &[]);
    assert!((path(&report) - 5.4).abs() < 0.15, "\n{report}");
    let report = examine(Oddity::Scale(4), 20);
    assert_only(&report, "wheels.counts", ["above robot.max_speed_m_s", "robot.ticks_per_turn"], &[]);
}

#[test]
fn signed_counts_of_16_bits_are_named_and_slow_groups_are_not() {
    assert_only(&examine(Oddity::WrapsSigned, 40), "wheels.counts", ["wraps at 16 bits", "32 bits"], &[]);
    let report = examine(Oddity::SlowSlots, 40);
    assert!(report.findings.iter().all(|finding| !finding.text.contains("scatter")), "\n{report}");
}

#[test]
fn clocks_are_named_and_not_taken_for_slots_or_the_supply() {
    let report = examine(Oddity::Milliseconds, 20);
    assert_only(&report, "clock.stamps", ["counts milliseconds", "micros()"], &[]);
    let report = examine(Oddity::RunsBack, 30);
    assert_only(&report, "clock.stamps", ["clock runs backwards", "counter of microseconds"], &[]);
}

#[test]
fn prints_are_quoted_and_the_cable_is_not_blamed() {
    let report = examine(Oddity::Prints, 20);
    assert_only(
        &report,
        "line.text",
        ["times readable text between frames: `dist=23 cm`", "as LOG"],
        &["sensors.rate"],
    );
}

#[test]
fn boards_that_give_no_sweep_are_named() {
    let report = examine(Oddity::Mute, 20);
    assert_only(&report, "line.board", ["does not say who it is (no HELLO)", "its RX"], &[]);
    let report = examine(Oddity::Ids, 20);
    assert_only(&report, "sensors.ids", ["echoes of sensor 100", "as GEOMETRY does"], &[]);
    let report = examine(Oddity::HalfAngles, 20);
    assert_only(&report, "line.content", ["half_angle_cdeg of GEOMETRY is 9500", "protocol/README.md"], &[]);
    let report = examine(Oddity::Count, 20);
    assert_only(&report, "line.settings", ["the places of 9 sensors but says it has 8", "[ring.circle]"], &[]);
    let report = examine(Oddity::Bearings, 20);
    assert_eq!(wrong(&report).len(), 0, "\n{report}");
    assert_only(&examine(Oddity::NeverFires, 20), "sensors.silent", ["fires no sensor", "reset button"], &[]);
}

#[test]
fn inspect_names_the_reason_of_each_refusal() {
    let folder = tempfile::tempdir().unwrap();
    let frame = |message: Message| FrameEncoder::default().encode(&message).to_vec();
    let refusals = |oddity: Oddity| {
        let path = folder.path().join("drive.mcap");
        let mut capture = CaptureWriter::create(&path, &CaptureInfo::default()).unwrap();
        OddBoard::new(oddity).run(4, |now_us, said| {
            let at = Timestamp::from_us(now_us);
            capture.record(&Record::Received { at, bytes: said.to_vec() }).unwrap();
            // The host would send these; the capture need not hold them.
            if now_us % 500_000 == 0 {
                [Message::GeometryRequest, Message::Start].map(frame).concat()
            } else {
                Vec::new()
            }
        });
        capture.finish().unwrap();
        let report = slamd::inspect::inspect(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        (report.refusals.clone(), report.to_string())
    };
    let (none, text) = refusals(Oddity::None);
    assert!(none.is_empty() && !text.contains("\nrefused"), "{text}");
    for (oddity, words) in [
        (Oddity::HalfAngles, "half_angle_cdeg of GEOMETRY is 9500, expected 0 to 9000"),
        (Oddity::Count, "the places of 9 sensors but says it has 8"),
        (Oddity::Ids, "SONAR names sensor 100, but the ring has 8"),
    ] {
        let (refusals, text) = refusals(oddity);
        assert!(refusals[0].contains(words) && text.contains(&format!("\nrefused    {}", refusals[0])), "{text}");
    }
}

#[test]
fn a_recording_gets_no_advice_that_only_a_live_board_can_take() {
    let mut examination = Examination::new(&Config::default(), 115_200, "test");
    let mut records = Vec::new();
    OddBoard::new(Oddity::Rests).run(10, |now_us, said| {
        records.push(Record::Received { at: Timestamp::from_us(now_us), bytes: said.to_vec() });
        let ask = [Message::GeometryRequest, Message::Start];
        if now_us % 500_000 == 0 {
            ask.map(|it| FrameEncoder::default().encode(&it).to_vec()).concat()
        } else {
            Vec::new()
        }
    });
    records.iter().for_each(|record| examination.feed(record));
    let report = examination.report();
    let fixes: Vec<&String> = report.findings.iter().filter_map(|finding| finding.fix.as_ref()).collect();
    assert!(fixes.iter().any(|fix| fix.starts_with("record a push of 30 cm")), "\n{report}");
    for live in ["while this runs", "--seconds", "reset button"] {
        assert!(fixes.iter().all(|fix| !fix.contains(live)), "\n{report}");
    }
}

#[test]
fn a_shipped_configuration_is_no_error_in_a_replay() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    let slamd = |arguments: &[&str]| {
        let mut slamd = std::process::Command::new(env!("CARGO_BIN_EXE_slamd"));
        let output = slamd.args(arguments).current_dir(folder.path()).output().unwrap();
        let [out, log] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        (output.status.code().unwrap(), out + &log)
    };
    assert_eq!(slamd(&["simulate", "--sensors", "8", "--duration", "30", "--capture", "a.mcap"]).0, 0);
    let ring8 = root.join("configs/ring8.toml");
    let ring8 = ring8.to_str().unwrap();
    let (code, text) = slamd(&["doctor", "--capture", "a.mcap", "--config", ring8]);
    assert!(code == 0 && !text.contains("does not answer"), "{text}");
    let (code, text) = slamd(&["replay", "a.mcap", "--config", ring8]);
    assert!(code == 0 && !text.contains("does not answer"), "{text}");
    // A recording of another ring: the key is named, and no other cause.
    let paper = root.join("replay/flat-paper-faults.mcap");
    let (code, text) = slamd(&["doctor", "--capture", paper.to_str().unwrap(), "--config", ring8]);
    assert_eq!(code, 65, "{text}");
    assert!(text.contains("problem  ring.circle.count gives the robot 8 sensors, but the board has 32"), "{text}");
    assert!(text.contains("-> set ring.circle.count = 32, or leave [ring.circle] out"), "{text}");
    assert!(!text.contains("rotation_deg") && !text.contains("warning  sensor"), "{text}");
}

#[test]
fn air_groups_and_crosstalk_are_named() {
    assert_only(&examine(Oddity::Air(8_000), 20), "sensors.temperature", ["80.0 degrees", "check the sensor"], &[]);
    assert_only(&examine(Oddity::Overlap, 20), "sensors.groups", ["groups overlap", "once per cycle"], &[]);
    assert_only(
        &examine(Oddity::Crosstalk, 30),
        "sensors.crosstalk",
        ["always measure the same", "different groups"],
        &[],
    );
}
