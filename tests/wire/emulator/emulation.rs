//! The firmware in its emulated microcontroller, in lock-step with the plant and with the host's end of the line.

#![allow(unreachable_pub, reason = "a test's module")]

use super::plant::{Bridge, Plant};
use slamd_core::Pose2;
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

/// Bytes wait this long in the USB bridge.
const LATENCY_US: u64 = 4_000;
/// Period of the true pose.
const TRUTH_US: u64 = 20_000;

/// An image and the emulator that runs it.
#[derive(Debug)]
pub struct Emulated {
    program: PathBuf,
    arguments: Vec<PathBuf>,
    pub wiring: Wiring,
}

/// What hangs on the board's pins.
#[derive(Clone, Copy, Debug)]
pub struct Wiring {
    pub sensors: u8,
    pub trigger_lines: u8,
}

/// The Mega's runner and image, built once.
///
/// # Panics
/// When a compiler or libsimavr is missing.
pub fn mega() -> &'static Emulated {
    static BUILT: OnceLock<Emulated> = OnceLock::new();
    BUILT.get_or_init(|| {
        let image = make("slamd_ring_mega2560.elf", "make gcc-avr avr-libc");
        let runner = folder().join("runner");
        let cc = Command::new("cc")
            .args(["-O2", "-Wall", "-Wextra", "-Werror", "-o"])
            .arg(&runner)
            .arg(root().join("tests/wire/emulator/runner.c"))
            .args(["-lsimavr", "-lelf"])
            .output()
            .expect("cc runs");
        let words = "install what it needs: apt-get install libsimavr-dev libelf-dev";
        assert!(cc.status.success(), "{}\n{words}", String::from_utf8_lossy(&cc.stderr));
        Emulated { program: runner, arguments: vec![image], wiring: Wiring { sensors: 32, trigger_lines: 8 } }
    })
}

/// The Pico's runner and image with this many sensors, and with motors if there are at most 8; the image is built once. None without the
/// emulator or the compiler, except where every test must run.
///
/// # Panics
/// When they are missing there.
pub fn pico(sensors: u8) -> Option<Emulated> {
    let pico = folder().join("pico");
    let has = |program: &str| Command::new(program).arg("--version").output().is_ok_and(|out| out.status.success());
    let missing = [
        (!has("node")).then_some("no node: apt-get install nodejs npm"),
        (!has("arm-none-eabi-gcc")).then_some("no compiler: apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi"),
        (!pico.join("node_modules/rp2040js").is_dir()).then_some(
            "no rp2040js: cp tests/wire/emulator/pico/package*.json target/emulator/pico/ && npm ci --prefix target/emulator/pico",
        ),
    ];
    if let Some(words) = missing.into_iter().flatten().next() {
        assert!(std::env::var_os("CI").is_none(), "{words}");
        println!("skipped: {words}");
        return None;
    }
    static BUILT: OnceLock<(PathBuf, PathBuf)> = OnceLock::new();
    let (runner, image) = BUILT.get_or_init(|| {
        // Beside its packages, where node looks for them.
        let runner = pico.join("runner.mjs");
        std::fs::copy(root().join("tests/wire/emulator/pico/runner.mjs"), &runner).expect("copied");
        (runner, make("slamd_ring_pico.uf2", "make gcc-arm-none-eabi libnewlib-arm-none-eabi python3"))
    });
    Some(Emulated {
        program: "node".into(),
        arguments: vec![runner.clone(), image.clone(), sensors.to_string().into()],
        wiring: Wiring { sensors, trigger_lines: 4 },
    })
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn folder() -> PathBuf {
    root().join("target/emulator")
}

/// An image, built by the firmware's Makefile with these packages.
fn make(image: &str, packages: &str) -> PathBuf {
    let folder = folder();
    std::fs::create_dir_all(&folder).expect("a folder for the image");
    let image = folder.join(image);
    let make = Command::new("make")
        .arg("-C")
        .arg(root().join("protocol/firmware"))
        .arg(format!("BUILD={}", folder.display()))
        .arg(&image)
        .output();
    let make = make.expect("make runs");
    print!("{}", String::from_utf8_lossy(&make.stdout));
    let words = format!("install what it needs: apt-get install {packages}");
    assert!(make.status.success(), "{}\n{words}", String::from_utf8_lossy(&make.stderr));
    image
}

/// What may befall a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mishap {
    Reset,
    /// The firmware stops with its interrupts off.
    Hang,
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
    /// What befalls the board now.
    fn mishap(&mut self) -> Option<Mishap> {
        None
    }
}

struct Runner {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

/// Runs the image for so many seconds of its own time, as fast as it goes.
pub fn run(board: &Emulated, seed: u64, seconds: u64, host: &mut impl Host) {
    run_with(board, Plant::new(seed, board.wiring), seconds, host);
}

/// The same with this plant.
pub fn run_with(board: &Emulated, mut plant: Plant, seconds: u64, host: &mut impl Host) {
    let mut child = Command::new(&board.program)
        .args(&board.arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
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
        match host.mishap() {
            Some(Mishap::Reset) => answer = "reset".into(),
            Some(Mishap::Hang) => answer = "hang".into(),
            None => {}
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
