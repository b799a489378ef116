//! `slamd doctor`: a healthy board gives no warning, and each thing that breaks is named with what to do about it.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::doctor::{Examination, Finding, Level, Report};
use slamd_capture::Record;
use slamd_core::{Config, Timestamp, config::SettingValue};
use slamd_protocol::{Echo, FrameDecoder, FrameEncoder, Message};
use slamd_sim::fault::FaultMix;
use slamd_sim::link::LinkFaults;
use slamd_sim::simulation::{SimConfig, Simulation};
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");
const STEP_US: u64 = 5_000;
const BAUD: u32 = 115_200;

fn board(sensors: u8, faults: &[&str], link: LinkFaults) -> Simulation {
    Simulation::new(SimConfig {
        world: World::named("flat").unwrap(),
        seed: 3,
        duration_s: 600.0,
        mix: FaultMix::None,
        faults: faults.iter().map(|fault| fault.parse().unwrap()).collect(),
        beam: BeamShape::Cone,
        sensors,
        odometry_errors: 1.0,
        clock_drift_ppm: 500.0,
        link,
    })
}

/// Examines a simulated board for `seconds`; `alter` may change what it says, `at_step` what happens to it.
fn examine_with(
    mut simulation: Simulation,
    seconds: u64,
    config: &Config,
    alter: Option<&dyn Fn(&mut Message)>,
    mut at_step: impl FnMut(u64, &mut Simulation),
) -> Report {
    let mut examination = Examination::new(config, BAUD, "test");
    let (mut decoder, mut encoder) = (FrameDecoder::new(), FrameEncoder::default());
    for now_us in (0..seconds * 1_000_000).step_by(usize::try_from(STEP_US).unwrap()) {
        let now = Timestamp::from_us(now_us);
        at_step(now_us, &mut simulation);
        while let Some(record) = simulation.poll(now) {
            let Record::Received { bytes, .. } = record else { continue };
            let Some(alter) = alter else {
                examination.received(now, &bytes);
                continue;
            };
            for byte in bytes {
                let Some(frame) = decoder.push(byte) else { continue };
                let mut message = Message::parse(frame.kind, frame.payload).unwrap();
                alter(&mut message);
                examination.received(now, &encoder.encode(&message));
            }
        }
        examination.run_until(now);
        for frame in examination.take_transmit() {
            simulation.hear(now, &frame);
            examination.sent(now, &frame);
        }
    }
    examination.report()
}

fn examine(sensors: u8, faults: &[&str], config: &Config) -> Report {
    examine_with(board(sensors, faults, LinkFaults::default()), 40, config, None, |_, _| {})
}

/// What a board says whose messages are changed on the way.
fn examine_altered(alter: impl Fn(&mut Message) + 'static) -> Report {
    let simulation = board(32, &[], LinkFaults::default());
    examine_with(simulation, 20, &Config::default(), Some(&alter), |_, _| {})
}

/// What these bytes are taken for, ten at a time, a hundred times a second.
fn examine_bytes(bytes: &[u8]) -> Report {
    let mut examination = Examination::new(&Config::default(), BAUD, "test");
    let mut bytes = bytes.iter().copied().cycle();
    for step in 0..600 {
        let chunk: Vec<u8> = bytes.by_ref().take(10).collect();
        examination.received(Timestamp::from_us(step * 10_000), &chunk);
    }
    examination.report()
}

#[track_caller]
fn find<'a>(report: &'a Report, id: &str) -> &'a Finding {
    report.findings.iter().find(|finding| finding.id == id).unwrap_or_else(|| panic!("no {id} in:\n{report}"))
}

#[track_caller]
fn assert_found(report: &Report, id: &str, level: Level, text: &str, fix: &str) {
    let finding = find(report, id);
    assert_eq!(finding.level, level, "{finding}");
    assert!(finding.text.contains(text), "{finding}");
    assert!(finding.fix.as_ref().unwrap().contains(fix), "{finding}");
}

#[test]
fn a_healthy_board_gives_no_warning() {
    for sensors in [32, 16, 8] {
        let report = examine(sensors, &[], &Config::default());
        let bad = report.findings.iter().filter(|finding| finding.level >= Level::Warning).count();
        assert_eq!(bad, 0, "{sensors} sensors:\n{report}");
        for id in
            ["line.board", "line.rate", "line.frames", "sensors.rate", "wheels.ahead", "clock.latency", "clock.drift"]
        {
            assert_eq!(find(&report, id).level, Level::Ok, "{report}");
        }
        assert_eq!(report.sensors.len(), usize::from(sensors));
        assert!(report.sensors.iter().all(|sensor| sensor.echoes > 0 && sensor.least_m <= sensor.mean_m), "{report}");
    }
}

#[test]
fn the_clocks_drift_is_measured() {
    let report = examine(8, &[], &Config::default());
    let text = &find(&report, "clock.drift").text;
    let ppm: f64 = text.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
    assert!((ppm.abs() - 500.0).abs() < 200.0, "{text}");
}

#[test]
fn broken_sensors_are_named() {
    let report = examine(32, &["3:missing", "9:saturated"], &Config::default());
    assert_found(&report, "sensor.dead", Level::Warning, "sensor 3 is dead", "sensor 3's plug");
    assert_found(&report, "sensor.no_echo", Level::Warning, "sensor 9 heard no echo", "30 cm in front of sensor 9");
    assert!(
        find(&report, "sensors.count").text.starts_with("30 of 32")
            || find(&report, "sensors.count").text.starts_with("29 of 32"),
        "{report}"
    );
    let report = examine(32, &["17:stuck", "21:noisy"], &Config::default());
    assert_found(&report, "sensor.noisy", Level::Warning, "sensor 21 is noisy", "sensor 21's plug");
    assert_found(&report, "sensor.stuck", Level::Warning, "sensor 17 is stuck at", "in front of sensor 17");
}

#[test]
fn a_stuck_pin_and_a_maximum_are_named() {
    let with = |sensor: u8, echo: Echo| {
        move |message: &mut Message| {
            if let Message::Sonar(sonar) = message {
                sonar.echoes.iter_mut().filter(|heard| heard.sensor == sensor).for_each(|heard| heard.echo = echo);
            }
        }
    };
    let report = examine_altered(with(5, Echo::HighAtTrigger));
    assert_found(&report, "sensor.pin", Level::Warning, "sensor 5: its echo pin is stuck", "sensor 5's echo wire");
    let report = examine_altered(with(6, Echo::Flight { us: 38_000 }));
    assert_found(&report, "sensor.maximum", Level::Warning, "sensor 6 always reads its maximum", "clean sensor 6");
    let report = examine_altered(|message| {
        if let Message::Status(status) = message {
            status.stuck_mask = 1 << 31;
        }
    });
    assert_found(&report, "sensor.pin", Level::Warning, "sensor 31", "sensor 31's echo wire");
}

#[test]
fn reversed_wheels_name_their_setting() {
    for (id, settings, fix) in [
        ("wheels.left_reversed", &["left_reversed"][..], "[board] left_reversed = false"),
        ("wheels.right_reversed", &["right_reversed"], "[board] right_reversed = false"),
        (
            "wheels.both_reversed",
            &["left_reversed", "right_reversed"],
            "[board] left_reversed = false and right_reversed = false",
        ),
    ] {
        let board = settings.iter().map(|name| ((*name).to_owned(), SettingValue::Flag(true))).collect();
        let config = Config { board, ..Config::default() };
        assert_found(&examine(8, &[], &config), id, Level::Warning, "if the robot was pushed straight ahead", fix);
    }
}

/// Counts of a hand's push of 40 cm and a turn on the spot, in place of the simulated ones.
fn pushed(message: &mut Message, start_us: u32, swapped: bool) {
    let (t_us, left, right) = match message {
        Message::Sonar(sonar) => (sonar.t_us, &mut sonar.left_ticks, &mut sonar.right_ticks),
        Message::Encoder(encoder) => (encoder.t_us, &mut encoder.left_ticks, &mut encoder.right_ticks),
        _ => return,
    };
    let seconds = f64::from(t_us.wrapping_sub(start_us)) * 1e-6;
    let (ahead, turn) = (2_600.0 * (seconds / 4.0).clamp(0.0, 1.0), 1_300.0 * ((seconds - 6.0) / 3.0).clamp(0.0, 1.0));
    let ticks = |ticks: f64| format!("{ticks:.0}").parse::<i32>().unwrap();
    (*left, *right) = (ticks(ahead - turn), ticks(ahead + turn));
    if swapped {
        std::mem::swap(left, right);
    }
}

#[test]
fn a_push_and_a_turn_tell_which_wheel_is_which() {
    for swapped in [false, true] {
        let start_us = std::cell::Cell::new(None);
        let report = examine_altered(move |message| {
            if let Message::Encoder(encoder) = &*message {
                start_us.set(start_us.get().or(Some(encoder.t_us)));
            }
            pushed(message, start_us.get().unwrap_or_default(), swapped);
        });
        if swapped {
            assert_found(&report, "wheels.swapped", Level::Warning, "turned right", "[board] wheels_swapped = true");
        } else {
            assert_eq!(find(&report, "wheels.sides").level, Level::Ok, "{report}");
        }
        assert_eq!(find(&report, "wheels.ahead").level, Level::Ok, "{report}");
    }
}

#[test]
fn a_robot_that_stands_is_asked_to_move_and_a_dead_encoder_is_named() {
    let ticks = |message: &mut Message, keep_right: bool| {
        let (left, right) = match message {
            Message::Sonar(sonar) => (&mut sonar.left_ticks, &mut sonar.right_ticks),
            Message::Encoder(encoder) => (&mut encoder.left_ticks, &mut encoder.right_ticks),
            _ => return,
        };
        *left = 0;
        if !keep_right {
            *right = 0;
        }
    };
    let report = examine_altered(move |message| ticks(message, false));
    assert_found(&report, "wheels.still", Level::Note, "did not move", "push the robot forward 30 cm while this runs");
    let report = examine_altered(move |message| ticks(message, true));
    assert_found(&report, "wheels.dead", Level::Problem, "left wheel's encoder does not count", "D21 and D20");
}

#[test]
fn damage_on_the_line_is_measured() {
    let link = LinkFaults { bit_flips: 0.0005, ..LinkFaults::default() };
    let report = examine_with(board(32, &[], link), 20, &Config::default(), None, |_, _| {});
    let finding = find(&report, "line.damaged");
    assert!(
        finding.level >= Level::Warning && finding.fix.as_ref().unwrap().contains("shorten the cable"),
        "{finding}"
    );
}

#[test]
fn frames_that_are_missing_are_counted() {
    let mut examination = Examination::new(&Config::default(), BAUD, "test");
    let mut encoder = FrameEncoder::default();
    for step in 0..500_u32 {
        let frame =
            encoder.encode(&Message::Encoder(slamd_protocol::Encoder { t_us: step * 20_000, ..Default::default() }));
        if step % 10 != 9 {
            examination.received(Timestamp::from_us(u64::from(step) * 20_000), &frame);
        }
    }
    assert_found(&examination.report(), "line.lost", Level::Problem, "49 frames", "without a hub");
}

#[test]
fn devices_that_are_no_slamd_board_are_distinguished() {
    let report = examine_bytes(b"Marlin 2.1.2 ready, temperature 24.0\r\n");
    assert_found(&report, "line.firmware", Level::Problem, "Marlin", "flash protocol/firmware");
    let noise: Vec<u8> = (0..997_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24).to_le_bytes()[0]).collect();
    assert_found(&examine_bytes(&noise), "line.noise", Level::Problem, "noise", "ground wire");
    let mut silent = Examination::new(&Config::default(), BAUD, "test");
    silent.run_until(Timestamp::from_us(20_000_000));
    assert_found(&silent.report(), "line.silence", Level::Problem, "silence", "is it powered");
}

#[test]
fn an_echoing_line_is_reported() {
    let mut examination = Examination::new(&Config::default(), BAUD, "test");
    for step in 0..1_000 {
        let now = Timestamp::from_us(step * 10_000);
        examination.run_until(now);
        for frame in examination.take_transmit() {
            examination.sent(now, &frame);
            examination.received(now, &frame);
        }
    }
    assert_found(
        &examination.report(),
        "line.echo",
        Level::Problem,
        "echoes",
        "separate the board's receive and transmit",
    );
}

#[test]
fn another_protocol_overruns_and_a_low_supply_are_reported() {
    let report = examine_altered(|message| {
        if let Message::Hello(hello) = message {
            hello.major += 1;
        }
    });
    assert_found(&report, "line.protocol", Level::Problem, "protocol mismatch", "update slamd");
    let report = examine_altered(|message| {
        if let Message::Status(status) = message {
            (status.overruns, status.supply_mv) = (status.frames, std::num::NonZeroU16::new(4_200));
        }
    });
    assert_found(&report, "line.overruns", Level::Warning, "because the line was busy", "encoder_period_ms");
    assert_found(&report, "line.supply", Level::Warning, "4.20 V", "their own supply");
}

#[test]
fn restarts_are_counted() {
    let simulation = board(8, &[], LinkFaults::default());
    let report = examine_with(simulation, 30, &Config::default(), None, |now_us, simulation| {
        if [10_000_000, 20_000_000].contains(&now_us) {
            simulation.restart_board();
        }
    });
    assert_found(&report, "line.restarts", Level::Problem, "restarted 2 times", "own supply");
}

fn doctor(arguments: &[&str]) -> Output {
    Command::new(SLAMD).arg("doctor").args(arguments).output().unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    let words = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {words}"))
}

#[test]
fn a_capture_is_examined_by_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("drive.mcap");
    let simulated = Command::new(SLAMD)
        .args(["simulate", "--duration", "30", "--fault", "4:missing", "--capture"])
        .arg(&capture)
        .output()
        .unwrap();
    assert!(simulated.status.success());
    let path = capture.to_str().unwrap();
    let output = doctor(&["--capture", path]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("warning  sensor 4 is dead"), "{text}");
    let report = json(&doctor(&["--capture", path, "--json"]));
    assert!(report["findings"].as_array().unwrap().iter().any(|finding| finding["id"] == "sensor.dead"), "{report}");
    assert_eq!(report["summary"]["problem"], 0);
    assert_eq!(report["sensors"][4]["answers"], 0);
}

#[test]
fn a_port_that_is_not_there_has_its_own_exit_code() {
    let output = doctor(&["--port", "/dev/nowhere", "--json"]);
    assert_eq!(output.status.code(), Some(69));
    let report = json(&output);
    let finding = report["findings"].as_array().unwrap().iter().find(|finding| finding["id"] == "port.open").unwrap();
    assert_eq!(finding["level"], "problem");
    assert!(finding["fix"].as_str().unwrap().contains("slamd ports"), "{finding}");
    assert_eq!(doctor(&[]).status.code(), Some(64));
}

#[expect(clippy::disallowed_methods, reason = "the pseudo-terminal appears when it appears")]
fn wait_for(port: &Path) {
    for _ in 0..200 {
        if port.exists() {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_live_board_is_examined() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("robot");
    let mut board = Command::new(SLAMD)
        .args(["simulate", "--fault", "2:missing", "--duration", "120", "--pty"])
        .arg(&port)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_for(&port);
    let output = doctor(&["--port", port.to_str().unwrap(), "--seconds", "9", "--json"]);
    board.kill().unwrap();
    board.wait().unwrap();
    let report = json(&output);
    assert_eq!(output.status.code(), Some(0), "{report}");
    let finding = |id: &str| report["findings"].as_array().unwrap().iter().find(|finding| finding["id"] == id).cloned();
    assert_eq!(finding("port.open").unwrap()["level"], "ok");
    assert!(finding("line.board").unwrap()["text"].as_str().unwrap().contains("simulator"));
    assert!(finding("sensor.dead").unwrap()["text"].as_str().unwrap().contains("sensor 2"));
    // Its level is that of the computer the test runs on.
    assert!(finding("clock.latency").unwrap()["text"].as_str().unwrap().contains("round trip"), "{report}");
}
