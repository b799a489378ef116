//! The firmware in its emulated microcontroller, in lock-step with the plant and with the host's end of the line.

#![allow(unreachable_pub, reason = "a test's module")]

use super::plant::{Bridge, Plant};
use slamd_core::Pose2;
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Bytes wait this long in the USB bridge.
const LATENCY_US: u64 = 4_000;
/// Period of the true pose.
const TRUTH_US: u64 = 20_000;

/// The runner and the firmware's image, built once.
///
/// # Panics
/// When a compiler or libsimavr is missing.
pub fn build() -> &'static (PathBuf, PathBuf) {
    static BUILT: std::sync::OnceLock<(PathBuf, PathBuf)> = std::sync::OnceLock::new();
    BUILT.get_or_init(build_anew)
}

fn build_anew() -> (PathBuf, PathBuf) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("target/emulator");
    std::fs::create_dir_all(&folder).expect("a folder for the runner");
    let make = Command::new("make")
        .arg("-C")
        .arg(root.join("protocol/firmware"))
        .arg(format!("BUILD={}", folder.display()))
        .arg(format!("{}/slamd_ring_mega2560.elf", folder.display()))
        .output();
    let make = make.expect("make runs");
    let words = "install what it needs: apt-get install make gcc-avr avr-libc";
    assert!(make.status.success(), "{}\n{words}", String::from_utf8_lossy(&make.stderr));
    let runner = folder.join("runner");
    let cc = Command::new("cc")
        .args(["-O2", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&runner)
        .arg(root.join("tests/wire/emulator/runner.c"))
        .args(["-lsimavr", "-lelf"])
        .output()
        .expect("cc runs");
    let words = "install what it needs: apt-get install libsimavr-dev libelf-dev";
    assert!(cc.status.success(), "{}\n{words}", String::from_utf8_lossy(&cc.stderr));
    (runner, folder.join("slamd_ring_mega2560.elf"))
}

/// The host's end of the line, in the emulated time.
pub trait Host {
    /// Bytes have come out of the bridge; what the host has written by now.
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8>;
    /// Where the robot truly is.
    fn truth(&mut self, at_us: u64, pose: Pose2);
    /// The plant, every few milliseconds.
    fn look(&mut self, _at_us: u64, _plant: &Plant) {}
    /// Whether the emergency switch is open.
    fn emergency(&self) -> bool {
        false
    }
    /// Whether the board is reset now.
    fn resets(&mut self) -> bool {
        false
    }
}

struct Runner {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

/// Runs the image for so many seconds of its own time, as fast as it goes.
pub fn run(runner: &Path, image: &Path, seed: u64, seconds: u64, host: &mut impl Host) {
    run_with(runner, image, Plant::new(seed), seconds, host);
}

/// The same with this plant.
pub fn run_with(runner: &Path, image: &Path, mut plant: Plant, seconds: u64, host: &mut impl Host) {
    let mut child =
        Command::new(runner).arg(image).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
    let (to, from) = (child.stdin.take().expect("piped"), BufReader::new(child.stdout.take().expect("piped")));
    let mut runner = Runner { child, to, from };
    let mut waiting = Vec::new();
    let mut line = String::new();
    loop {
        line.clear();
        assert!(runner.from.read_line(&mut line).expect("the runner speaks") > 0, "the runner ended");
        let mut words = line.split_whitespace();
        let us: u64 = words.next().and_then(|word| word.parse().ok()).expect("a time");
        waiting.extend(from_hex(words.next().expect("bytes")));
        plant.run_until(us);
        plant.bridges([bridge(words.next()), bridge(words.next())]);
        let [left, right] = plant.ticks(us);
        let mut answer = format!("{left}{} {right} ", if host.emergency() { "!" } else { "" });
        let mut pulses = String::new();
        let triggered = words.next();
        for pulse in triggered.map_or(Vec::new(), |lines| plant.ping(us, lines.parse().expect("lines"))) {
            let _ = write!(pulses, " {}:{}:{}", pulse.sensor, pulse.rise_us, pulse.fall_us);
        }
        let written = if us.is_multiple_of(LATENCY_US) && triggered.is_none() {
            let written = host.exchange(us, &std::mem::take(&mut waiting));
            host.look(us, &plant);
            if us.is_multiple_of(TRUTH_US) {
                host.truth(us, plant.pose(us));
            }
            written
        } else {
            Vec::new()
        };
        answer.push_str(&to_hex(&written));
        answer.push_str(&pulses);
        if us >= seconds * 1_000_000 {
            let _ = runner.to.write_all(b"\n");
            let _ = runner.child.wait();
            return;
        }
        if host.resets() {
            answer = "reset".into();
        }
        writeln!(runner.to, "{answer}").expect("the runner listens");
    }
}

fn bridge(word: Option<&str>) -> Bridge {
    let word = word.expect("what a bridge does");
    word.parse::<f64>().map_or(Bridge::Brake, |thousandths| Bridge::Voltage(1e-3 * thousandths))
}

fn from_hex(text: &str) -> impl Iterator<Item = u8> {
    let digits = if text == "-" { "" } else { text };
    (0..digits.len() / 2).map(move |at| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).expect("hexadecimal"))
}

fn to_hex(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "-".into();
    }
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
