//! `slamd setup`: from a robot that is not what its board says to a configuration with which the map is right.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::setup::{Measured, Progress, Setup};
use slamd_capture::Record;
use slamd_core::{Config, Driver, Event, Input, Pipeline, Pose2, Start, Timestamp, Update};
use slamd_protocol::{FrameDecoder, FrameEncoder, Message, Setting};
use slamd_sim::simulation::{SimConfig, Simulation};
use slamd_sim::world::World;
use slamd_testkit::odd_board::{OddBoard, Oddity};
use std::io::BufRead as _;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const STEP_US: usize = 5_000;

pub(crate) fn robot(sensors: u8, faults: &[&str]) -> Simulation {
    seeded(1, sensors, faults)
}

fn seeded(seed: u64, sensors: u8, faults: &[&str]) -> Simulation {
    let faults: Vec<_> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    Simulation::new(SimConfig::usual(World::named("flat").unwrap(), seed, 600.0, sensors)).with_robot_faults(&faults)
}

/// Sets a robot up that drives by itself. The file's text, and how long it took, seconds of the robot's time.
pub(crate) fn set_up(simulation: &mut Simulation, seconds: u64) -> Result<(String, f64), String> {
    let mut setup = Setup::new(Measured::default(), 115_200, "test", seconds as f64);
    for now_us in (0..(seconds + 1) * 1_000_000).step_by(STEP_US) {
        let now = Timestamp::from_us(now_us);
        while let Some(record) = simulation.poll(now) {
            if let Record::Received { bytes, .. } = record {
                setup.received(now, &bytes);
            }
        }
        setup.run_until(now);
        for frame in setup.take_transmit() {
            simulation.hear(now, &frame);
            setup.sent(now, &frame);
        }
        match setup.progress() {
            Progress::Busy => {}
            Progress::Done(text) => return Ok((text.clone(), now.seconds())),
            Progress::Failed(text) => return Err(text.clone()),
        }
    }
    Err("it never ends".into())
}

/// Sets a robot up that drives by itself, with a person who turns its left wheel forward when asked. The file's text.
fn set_up_with_person(
    simulation: &mut Simulation,
    are_plugs_swapped: bool,
    are_counts_reversed: bool,
) -> Result<String, String> {
    const SECONDS: u64 = 400;
    let mut setup = Setup::new(Measured::default(), 115_200, "test", SECONDS as f64).with_person(true);
    let (mut decoder, mut heard, mut encoder) = (FrameDecoder::new(), FrameDecoder::new(), FrameEncoder::default());
    // The true counts when the robot was lifted, and how often the wheel was seen since.
    let (mut lifted, mut is_lifted, mut seen) = ([0, 0], false, 0);
    let (mut is_swapped, mut is_reversed) = (false, [false; 2]);
    let mut asked = 0;
    for now_us in (0..(SECONDS + 1) * 1_000_000).step_by(STEP_US) {
        let now = Timestamp::from_us(now_us);
        let is_asked = setup.instruction().starts_with("which wheel is which");
        asked += u32::from(is_asked && !is_lifted);
        is_lifted = is_asked;
        while let Some(record) = simulation.poll(now) {
            let Record::Received { bytes, .. } = record else { continue };
            for byte in bytes {
                let Some(frame) = decoder.push(byte) else { continue };
                let mut message = Message::parse(frame.kind, frame.payload).unwrap();
                let counts = match &mut message {
                    Message::Sonar(sonar) => Some((&mut sonar.left_ticks, &mut sonar.right_ticks)),
                    Message::Encoder(encoder) => Some((&mut encoder.left_ticks, &mut encoder.right_ticks)),
                    _ => None,
                };
                if let Some((left, right)) = counts {
                    if !is_lifted {
                        (lifted, seen) = ([*left, *right], 0);
                    } else {
                        // It stands for some seconds, then one wheel turns; `left` is what the board calls so.
                        seen += 1;
                        let turned = (seen - 300).clamp(0, 400);
                        (*left, *right) = (lifted[0], lifted[1]);
                        let is_left = is_swapped == are_plugs_swapped;
                        let is_backward = are_counts_reversed != is_reversed[usize::from(!is_left)];
                        *(if is_left { left } else { right }) += if is_backward { -2 * turned } else { 2 * turned };
                    }
                }
                setup.received(now, &encoder.encode(&message));
            }
        }
        setup.run_until(now);
        for frame in setup.take_transmit() {
            for byte in &frame {
                let Some(sent) = heard.push(*byte) else { continue };
                let Ok(Message::ConfigSet { key, value }) = Message::parse(sent.kind, sent.payload) else { continue };
                match Setting::from_key(key) {
                    Some(Setting::WheelsSwapped) => is_swapped = value == 1,
                    Some(Setting::LeftReversed) => is_reversed[0] = value == 1,
                    Some(Setting::RightReversed) => is_reversed[1] = value == 1,
                    _ => {}
                }
            }
            simulation.hear(now, &frame);
            setup.sent(now, &frame);
        }
        match setup.progress() {
            Progress::Busy => {}
            Progress::Done(text) => {
                assert_eq!(asked, 1, "asked {asked} times:\n{text}");
                return Ok(text.clone());
            }
            Progress::Failed(text) => return Err(text.clone()),
        }
    }
    Err("it never ends".into())
}

/// Maps with this configuration for so long. The RMS of the position errors against the truth, metres, aligned at the first pose.
fn ate_m(simulation: &mut Simulation, config: &Config, seconds: u64) -> f64 {
    let mut driver = Driver::new(Pipeline::new(config, Start::Fresh).unwrap());
    let mut truths: Vec<(f64, Pose2)> = Vec::new();
    let mut poses: Vec<(f64, Pose2)> = Vec::new();
    for now_us in (0..seconds * 1_000_000).step_by(STEP_US) {
        let now = Timestamp::from_us(now_us);
        let mut frames = Vec::new();
        let mut take = |update: Update<'_>| match update {
            Update::Event(Event::Estimate(estimate)) => poses.push((estimate.at.seconds(), estimate.pose)),
            Update::Transmit(frame) => frames.push(frame.clone()),
            _ => {}
        };
        driver.advance(now, |_, update| take(update));
        while let Some(record) = simulation.poll(now) {
            match record {
                Record::Received { bytes, .. } => {
                    driver.handle(Input::Received { at: now, bytes: &bytes }, |_, update| take(update));
                }
                Record::Truth { at, pose } => truths.push((at.seconds(), pose)),
                _ => {}
            }
        }
        for frame in frames {
            simulation.hear(now, &frame);
            driver.handle(Input::Sent { at: now, bytes: &frame }, |_, _| {});
        }
    }
    // The truth of a sweep is that of its last group, within a sweep of the estimate's time.
    let truth = |at: f64| truths.iter().min_by(|a, b| (a.0 - at).abs().total_cmp(&(b.0 - at).abs())).unwrap().1;
    let (first_at, first) = *poses.first().unwrap();
    let map_from_world = first * truth(first_at).inverse();
    let squares = poses.iter().map(|(at, pose)| {
        let true_pose = map_from_world * truth(*at);
        (true_pose.position() - pose.position()).norm_squared()
    });
    (squares.sum::<f64>() / poses.len() as f64).sqrt()
}

#[test]
fn swapped_wheels_and_twice_the_ticks_are_found_and_the_map_is_right() {
    for seed in [1, 2, 3] {
        from_setup_to_map(seed);
    }
}

fn from_setup_to_map(seed: u64) {
    const FAULTS: &[&str] = &["wheels-swapped", "ticks=2"];
    let (text, took_s) = set_up(&mut seeded(seed, 8, FAULTS), 300).unwrap();
    println!("{text}\nset up in {took_s:.0} s");
    assert!(took_s < 120.0, "{took_s} s");
    let config = Config::from_toml(&text).unwrap();
    let board_says = 1_440.0;
    let ticks = f64::from(config.robot.ticks_per_turn.unwrap());
    assert!((ticks / board_says - 2.0).abs() < 0.06, "{text}");
    assert!(text.contains("\nwheels_swapped = true\n") && text.contains("\ncount = 8\n"), "{text}");
    assert!((config.robot.wheel_base_m / 0.26 - 1.0).abs() < 0.05, "{text}");
    // The robot is put back to its start and switched on.
    let ate_m = ate_m(&mut seeded(seed, 8, FAULTS), &config, 120);
    println!("ATE {ate_m:.3} m");
    assert!(ate_m <= 0.1, "{ate_m} m");
}

#[test]
fn each_mistake_has_its_keys_and_values() {
    let found =
        |faults: &[&str]| set_up(&mut robot(16, faults), 300).unwrap_or_else(|error| panic!("{faults:?}: {error}"));
    let (text, took_s) = found(&[]);
    let config = Config::from_toml(&text).unwrap();
    assert!(text.contains("the robot is as the board says") && took_s < 90.0, "{took_s} s: {text}");
    assert_eq!(
        (config.robot.ticks_per_turn, config.ring.rotation_deg, config.board.len()),
        (Some(1_440), 0.0, 0),
        "{text}"
    );
    let (text, _) = found(&["ring-rotated=90"]);
    assert!((Config::from_toml(&text).unwrap().ring.rotation_deg.abs() - 90.0).abs() < 1e-9, "{text}");
    let (text, _) = found(&["wheels-reversed"]);
    assert!(text.contains("left_reversed = true") && text.contains("right_reversed = true"), "{text}");
    let (text, _) = found(&["base=1.6"]);
    let base_m = Config::from_toml(&text).unwrap().robot.wheel_base_m;
    assert!((base_m / (1.6 * 0.26) - 1.0).abs() < 0.07, "{text}");
}

#[test]
fn a_person_tells_swapped_wheels_from_a_mirrored_ring() {
    let text = set_up_with_person(&mut robot(16, &["wheels-swapped"]), true, false).unwrap();
    assert!(text.contains("\nwheels_swapped = true\n") && !text.contains("mirrored = true"), "{text}");
    assert!(!text.contains("walls cannot tell"), "{text}");
    let text = set_up_with_person(&mut robot(16, &["ring-mirrored"]), false, false).unwrap();
    assert!(text.contains("\nmirrored = true\n") && !text.contains("wheels_swapped = true"), "{text}");
    // A robot that the walls take for one with its ring the wrong way round, in a mirror image of the home.
    let text = set_up_with_person(&mut robot(16, &["wheels-reversed", "ring-mirrored"]), false, true).unwrap();
    let config = Config::from_toml(&text).unwrap();
    assert!(text.contains("left_reversed = true") && text.contains("right_reversed = true"), "{text}");
    assert!(config.ring.mirrored && config.ring.rotation_deg.abs() < 1e-9, "{text}");
    assert!(!text.contains("wheels_swapped = true") && !text.contains("walls cannot tell"), "{text}");
    // Without a person the file says that there are two possibilities.
    let (text, _) = set_up(&mut robot(16, &["ring-mirrored"]), 300).unwrap();
    assert!(text.contains("walls cannot tell") && text.contains("mirrored = true in [ring]"), "{text}");
}

#[test]
fn a_board_gets_its_settings_back_where_no_file_is_written() {
    let mut simulation = robot(16, &["wheels-swapped"]);
    let mut setup = Setup::new(Measured::default(), 115_200, "test", 300.0);
    let (mut heard, mut settings) = (FrameDecoder::new(), Vec::new());
    // Interrupted once something was found, and again at an end of its own.
    let mut taken_back_at_us = None;
    for now_us in (0..120_000_000).step_by(STEP_US) {
        let own = Timestamp::from_us(now_us - taken_back_at_us.unwrap_or_default());
        while let Some(record) = simulation.poll(Timestamp::from_us(now_us)) {
            if let Record::Received { bytes, .. } = record {
                setup.received(own, &bytes);
            }
        }
        setup.run_until(own);
        for frame in setup.take_transmit() {
            for byte in &frame {
                let Some(sent) = heard.push(*byte) else { continue };
                if let Ok(Message::ConfigSet { key, value }) = Message::parse(sent.kind, sent.payload) {
                    settings.push((Setting::from_key(key), value));
                }
            }
            simulation.hear(Timestamp::from_us(now_us), &frame);
            setup.sent(own, &frame);
        }
        if taken_back_at_us.is_none() && setup.found().iter().any(|line| line.contains("swapped")) {
            taken_back_at_us = settings.contains(&(Some(Setting::WheelsSwapped), 1)).then(|| {
                assert!(setup.take_back());
                now_us
            });
        } else if taken_back_at_us.is_some_and(|at_us| now_us > at_us + 4_000_000) {
            break;
        }
    }
    assert!(taken_back_at_us.is_some(), "nothing was found");
    assert_eq!(settings.last(), Some(&(Some(Setting::WheelsSwapped), 0)), "{settings:?}");
    assert_eq!(setup.not_taken_back(), [""; 0]);
}

#[test]
fn a_board_that_gives_no_readings_is_named_and_nothing_is_written() {
    let mut setup = Setup::new(Measured::default(), 115_200, "test", 120.0);
    OddBoard::new(Oddity::Ids).run(110, |now_us, said| {
        let now = Timestamp::from_us(now_us);
        setup.received(now, said);
        setup.run_until(now);
        let frames = setup.take_transmit();
        frames.iter().for_each(|frame| setup.sent(now, frame));
        frames.concat()
    });
    let Progress::Failed(text) = setup.progress() else { panic!("{:?}", setup.progress()) };
    assert!(text.contains("echoes of sensor 100") && text.contains("as GEOMETRY does"), "{text}");
}

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");

/// A simulated robot on a pseudo-terminal, killed at the end.
pub(crate) struct Board(Child);

#[expect(clippy::disallowed_methods, reason = "waits for a program")]
impl Board {
    pub(crate) fn new(folder: &Path, arguments: &[&str]) -> Self {
        let mut simulate = Command::new(SLAMD);
        simulate.args(["simulate", "--pty", "board"]).args(arguments).current_dir(folder);
        let board = Self(simulate.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let begin = Instant::now();
        while !folder.join("board").exists() {
            assert!(begin.elapsed() < Duration::from_secs(10), "no board");
            std::thread::sleep(Duration::from_millis(20));
        }
        board
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn slamd(folder: &Path, arguments: &[&str]) -> Output {
    let mut slamd = Command::new(SLAMD);
    slamd.args(arguments).current_dir(folder).env("XDG_CONFIG_HOME", folder).stdin(Stdio::null());
    slamd.output().unwrap()
}

/// Told as it is found, and an interrupted setup says what it leaves.
#[test]
fn what_is_found_is_told_at_once_and_a_signal_ends_it_with_the_boards_settings_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let _board =
        Board::new(folder.path(), &["--sensors", "16", "--duration", "600", "--robot-fault", "wheels-swapped"]);
    let mut setup = Command::new(SLAMD);
    setup.args(["setup", "--port", "board"]).current_dir(folder.path()).stdin(Stdio::null());
    let mut setup = setup.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    let mut lines = std::io::BufReader::new(setup.stderr.take().unwrap()).lines().map_while(Result::ok);
    for line in lines.by_ref() {
        said = said + &line + "\n";
        if said.contains("found: left and right wheel are swapped") && line.contains("now ") {
            break;
        }
    }
    let setup_id = rustix::process::Pid::from_child(&setup);
    rustix::process::kill_process(setup_id, rustix::process::Signal::INT).unwrap();
    said.extend(lines.map(|line| line + "\n"));
    assert_eq!(setup.wait().unwrap().code(), Some(75), "{said}");
    assert!(said.contains("the board has its settings of before again"), "{said}");
    assert!(said.contains("interrupted: nothing was written"), "{said}");
    assert!(!folder.path().join("robot.toml").exists());
}

/// The path of a person who has just built a robot, in real time: fresh folder, board, `slamd setup`, map.
#[test]
#[expect(clippy::disallowed_methods, reason = "a person's time")]
fn a_fresh_folder_becomes_a_robot_with_a_map() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let faults = ["--robot-fault", "wheels-swapped", "--robot-fault", "ticks=2"];
    let board = Board::new(folder, &[&["--sensors", "8", "--duration", "600"][..], &faults].concat());
    let begin = Instant::now();
    let output = slamd(folder, &["setup", "--port", "board"]);
    let took = begin.elapsed();
    let (said, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    println!("{said}\nset up in {:.1} s", took.as_secs_f64());
    assert!(output.status.success(), "{log}");
    assert!(took < Duration::from_secs(120), "{took:?}");
    assert!(said.contains("now: slamd --port board --config robot.toml"), "{said}");
    let config = Config::from_toml(&std::fs::read_to_string(folder.join("robot.toml")).unwrap()).unwrap();
    assert!(config.robot.ticks_per_turn.is_some_and(|ticks| (2_800..2_960).contains(&ticks)), "{said}");
    assert_eq!(config.settings().count(), 1, "{said}");
    // The board has taken the setting over; the model check agrees with the file.
    let run = slamd(folder, &["--port", "board", "--config", "robot.toml", "--duration", "25", "--json"]);
    let summary: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(summary["model"].as_array().map(Vec::len), Some(0), "{summary}");
    assert!(summary["map_m2"].as_f64().is_some_and(|m2| m2 > 3.0), "{summary}");
    drop(board);
    // What is there is not replaced, and nothing half remains.
    let again = slamd(folder, &["setup", "--port", "board"]);
    assert_eq!(again.status.code(), Some(73));
    assert!(String::from_utf8_lossy(&again.stderr).contains("robot.toml exists and is kept"));
    std::fs::create_dir(folder.join("out")).unwrap();
    let named = slamd(folder, &["setup", "--port", "board", "--out", "out"]);
    assert!(named.status.code() == Some(64) && String::from_utf8_lossy(&named.stderr).contains("out is a folder"));
    let gone = slamd(folder, &["setup", "--port", "board", "--out", "other.toml"]);
    assert!(gone.status.code() == Some(69) && !folder.join("other.toml").exists());
}
