//! The firmware's unchanged images in an emulated ATmega2560 and an emulated RP2040: they drive the real program over a
//! pseudo-terminal, and they are held to golden captures.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod driving;
mod emulation;
mod hosts;
mod pico;
mod plant;

use emulation::Emulated;
use hosts::{Recording, Script, Wire};
use slamd::source::session::Session;
use slamd_capture::{CaptureInfo, CaptureReader, CaptureWriter, Record};
use slamd_core::{Config, Pose2, Timestamp};
use slamd_metrics::{Accuracy, AccuracyMeter};
use slamd_sim::link::LinkFaults;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_testkit::mock_port;
use slamd_testkit::mock_port::daemon::Daemon;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// How long each drive takes, and how much of the first is golden.
const DRIVE_S: u64 = 90;
const GOLDEN_S: u64 = 60;
/// Drives in lock-step whose mean error is held against the simulator's own board. The noise of the two differs draw by draw, and a drive's
/// error by half from the mean: fewer drives would compare the draws, not the boards.
const LOCK_STEP_DRIVES: u64 = 24;
/// A board in real time wants a core for itself.
static MACHINE: Mutex<()> = Mutex::new(());

fn output(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("target/emulator").join(name)
}

/// The drive with the simulator's own board, without any serial line.
fn direct(sensors: u8, seed: u64) -> Accuracy {
    let mut daemon = Session::new(
        slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap(),
        &output(&format!("direct-{sensors}-{seed}")),
    )
    .unwrap();
    let drive = SimConfig { sensors, ..mock_port::drive(seed, LinkFaults::default(), DRIVE_S as f64) };
    for record in session(Simulation::new(drive)) {
        daemon.feed(&record).unwrap();
        daemon.take_transmit();
    }
    daemon.finish().unwrap().0.accuracy.unwrap()
}

/// The same drive with the emulated board, in the board's own time.
fn in_lock_step(board: &Emulated, seed: u64) -> Accuracy {
    let out = output(&format!("emulated-{}-{seed}", board.wiring.sensors));
    let mut host = Recording::new(
        Session::new(slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap(), &out).unwrap(),
        None,
    );
    emulation::run(board, seed, DRIVE_S, &mut host);
    host.finish().accuracy.unwrap()
}

/// The same drive by `slamd --port` and the emulated board, in real time.
fn over_the_wire(board: &Emulated, seed: u64, seconds: u64) -> Accuracy {
    let out = output(&format!("wire-{}-{seed}", board.wiring.sensors));
    let recording = out.with_extension("mcap");
    // A recording of an earlier run is not written over: this one would have another name.
    let _ = std::fs::remove_file(&recording);
    // Inherited by what is started here. Not everybody may; then the machine should be idle.
    let _ = rustix::process::setpriority_process(None, -20);
    let mut host = Wire::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(&host.terminal.path).arg("--out").arg(&out).arg("--record").arg(&recording);
    let mut daemon = Daemon::run(command);
    daemon.expect("link: listening", Duration::from_secs(5));
    emulation::run(board, seed, seconds, &mut host);
    assert!(daemon.has_said("link: streaming"));
    daemon.end();
    let summary: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    // A busy machine reads too late now and then; bytes are lost as on a UART.
    println!("seed {seed}: the board at most {} ms late, {} bytes lost", host.late.as_millis(), host.lost_bytes);
    assert!(summary["sweeps"].as_u64().unwrap() > 8 * seconds, "{summary}");
    let zero_us = CaptureReader::open(&recording).unwrap().info().unix_zero_us.unwrap();
    accuracy(&std::fs::read_to_string(out.join("trajectory.tum")).unwrap(), &host.truth, zero_us)
}

/// What a trajectory's file is worth, given the truth by Unix time.
fn accuracy(tum: &str, truth: &[(u64, Pose2)], unix_zero_us: u64) -> Accuracy {
    let mut meter = AccuracyMeter::default();
    let mut truth = truth.iter().map(|(us, pose)| (Timestamp::from_us(us.saturating_sub(unix_zero_us)), *pose));
    for line in tum.lines() {
        let fields: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let at = Timestamp::default() + Duration::from_secs_f64(fields[0]);
        for (truly_at, pose) in truth.by_ref() {
            meter.truth(truly_at, pose);
            if truly_at > at {
                break;
            }
        }
        meter.estimate(at, Pose2::new(fields[1], fields[2], 2.0 * libm::atan2(fields[6], fields[7])));
    }
    meter.accuracy().unwrap()
}

fn mean_ate_m(runs: &[Accuracy]) -> f64 {
    runs.iter().map(|run| run.ate_m).sum::<f64>() / runs.len() as f64
}

#[test]
fn the_emulated_board_maps_through_the_real_program() {
    let _machine = MACHINE.lock();
    let board = emulation::mega();
    let wires = std::thread::scope(|scope| {
        let wires = [1, 2, 3].map(|seed| scope.spawn(move || over_the_wire(board, seed, DRIVE_S)));
        wires.map(|wire| wire.join().unwrap())
    });
    println!("over the wire: {wires:?}");
    let simulated = compare_in_lock_step(board, LOCK_STEP_DRIVES);
    let (wire_m, wire_simulated_m) = (mean_ate_m(&wires), mean_ate_m(&simulated[..wires.len()]));
    println!("mean ATE by slamd --port {wire_m:.4} m, simulated {wire_simulated_m:.4} m");
    // Three drives scatter by more than they differ, and a busy machine loses bytes: bounded, and printed for comparison.
    assert!(wire_m <= 0.15, "{wire_m} m against {wire_simulated_m} m");
}

/// Holds the mean error of so many drives against the simulator's own board, and returns the latter's.
fn compare_in_lock_step(board: &Emulated, drives: u64) -> Vec<Accuracy> {
    let pairs = in_pairs(board, drives);
    for (seed, (emulated, simulated)) in (1..).zip(&pairs) {
        println!("seed {seed}: ATE emulated {:.4} m, simulated {:.4} m", emulated.ate_m, simulated.ate_m);
    }
    let (emulated, simulated): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let (emulated_m, simulated_m) = (mean_ate_m(&emulated), mean_ate_m(&simulated));
    println!(
        "mean ATE: emulated {emulated_m:.4} m, simulated {simulated_m:.4} m, {:.2} times; pictures in {}",
        emulated_m / simulated_m,
        output("").display()
    );
    // A fifth more, or half a centimetre: where both are within two centimetres, a fifth is less than the readings' own grain.
    assert!(emulated_m <= (1.2 * simulated_m).max(simulated_m + 0.005), "{emulated_m} m against {simulated_m} m");
    simulated
}

/// Drives with the emulated and the simulated board, on all cores.
fn in_pairs(board: &Emulated, drives: u64) -> Vec<(Accuracy, Accuracy)> {
    let next = AtomicU64::new(1);
    let work = || {
        let mut done = Vec::new();
        while let Some(seed) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|seed| *seed <= drives) {
            done.push((seed, (in_lock_step(board, seed), direct(board.wiring.sensors, seed))));
        }
        done
    };
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let mut pairs: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    pairs.sort_by_key(|(seed, _)| *seed);
    pairs.into_iter().map(|(_, pair)| pair).collect()
}

/// After a change of the firmware the capture is rewritten: `WRITE_GOLDEN=1 cargo test --test wire golden`.
#[test]
fn the_firmware_sends_the_golden_capture_to_the_bit() {
    let _machine = MACHINE.lock();
    let bytes = sends_the_golden_capture(emulation::mega(), "flat-emulated-mega.mcap", "ATmega2560", GOLDEN_S);
    assert!(bytes > 100_000, "{bytes} bytes");
}

/// Compares what the image sends with the capture in `replay/` and returns the bytes compared.
fn sends_the_golden_capture(board: &Emulated, file: &str, chip: &str, seconds: u64) -> usize {
    const SEED: u64 = 1;
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay").join(file);
    if std::env::var_os("WRITE_GOLDEN").is_some() {
        let folder = tempfile::tempdir().unwrap();
        let config = Config::default();
        let info = CaptureInfo {
            slamd_version: env!("CARGO_PKG_VERSION").into(),
            protocol_version: format!("{}.{}", slamd_protocol::VERSION_MAJOR, slamd_protocol::VERSION_MINOR),
            config_toml: config.to_toml(),
            unix_zero_us: None,
            notes: format!("protocol/firmware in an emulated {chip}, world flat, seed {SEED}; the project's own"),
            faults: Some(Vec::new()),
        };
        let session =
            Session::new(slamd_paper::pipeline(&config, slamd_core::Start::Fresh).unwrap(), folder.path()).unwrap();
        let mut host = Recording::new(session, Some(CaptureWriter::create(&golden, &info).unwrap()));
        emulation::run(board, SEED, seconds, &mut host);
        host.finish();
    }
    let mut host = Script::new(&golden);
    emulation::run(board, SEED, seconds, &mut host);
    let mut heard = host.heard.into_iter();
    let mut bytes_compared = 0;
    for record in CaptureReader::open(&golden).unwrap() {
        if let Record::Received { at, bytes } = record.unwrap() {
            bytes_compared += bytes.len();
            assert_eq!(heard.next(), Some((at.us(), bytes)), "the firmware sends something else");
        }
    }
    assert_eq!(heard.next(), None, "the firmware sends more");
    bytes_compared
}
