//! The real program killed with SIGKILL while it records, and what its capture then holds.
//!
//! The board prints a line with its number and the time every two milliseconds, at the rate of a ring, so the last line in the capture says
//! what was lost.

use crate::mock_port::Terminal;
use crate::mock_port::daemon::Daemon;
use slamd_capture::{CaptureReader, Record};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What one kill showed.
#[derive(Clone, Copy, Debug)]
pub struct Killed {
    /// Lines in the capture; 0 where the program was killed before it recorded.
    pub lines: u64,
    /// Age of the newest recorded line at the kill, milliseconds; none where nothing was recorded.
    pub lost_ms: Option<f64>,
}

/// Most of what a killed recording may lose, milliseconds.
pub const MAX_LOST_MS: f64 = 100.0;
const LINE_EVERY: Duration = Duration::from_millis(2);
const LONGEST_US: u64 = 1_500_000;

/// Kills the program `count` times, `workers` at once, at times drawn from the seed.
pub fn kill(count: u64, workers: u64, seed: u64, progress: impl Fn() + Sync) -> Vec<Killed> {
    let next = AtomicU64::new(0);
    std::thread::scope(|scope| {
        let run = || {
            let mut killed = Vec::new();
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= count {
                    return killed;
                }
                killed.push(once(seed ^ i.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
                progress();
            }
        };
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(run)).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("each capture opens")).collect()
    })
}

#[expect(clippy::disallowed_methods, reason = "the kill is a moment in real time")]
fn once(seed: u64) -> Killed {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = folder.path().join("drive.mcap");
    let mut terminal = Terminal::open();
    let mut command = Command::new(crate::program());
    command.arg("--port").arg(&terminal.path).arg("--record").arg(&capture).arg("--out").arg(folder.path().join("out"));
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    let daemon = Daemon::run(command);
    let begin = Instant::now();
    // The seed decides how soon: also before the file is there.
    let until = Duration::from_micros((seed >> 7) % LONGEST_US);
    let mut line = 0u64;
    while begin.elapsed() < until {
        let text = format!("{line:08} {:09}\n", begin.elapsed().as_micros());
        // A line that does not fit waits: the pseudo-terminal loses nothing.
        line += u64::from(terminal.write(text.as_bytes()) == 0);
        let _ = terminal.read();
        std::thread::sleep(LINE_EVERY);
    }
    let killed_us = begin.elapsed().as_micros() as f64;
    drop(daemon);
    let killed = examine(&capture, killed_us);
    assert!(killed.lines <= line);
    killed
}

/// Reads the capture: it opens, and its lines follow on each other.
fn examine(capture: &Path, killed_us: f64) -> Killed {
    if !capture.exists() {
        return Killed { lines: 0, lost_ms: None };
    }
    let reader = CaptureReader::open(capture).expect("the capture opens");
    let bytes: Vec<u8> = reader
        .flat_map(|record| match record.expect("the capture is sound") {
            Record::Received { bytes, .. } => bytes,
            _ => Vec::new(),
        })
        .collect();
    let text = String::from_utf8(bytes).expect("what the board printed");
    let is_whole = text.ends_with('\n');
    let mut lines: Vec<&str> = text.lines().collect();
    if !is_whole {
        lines.pop();
    }
    // The port may have been opened in the middle of a line.
    let lines: Vec<(u64, f64)> = lines
        .iter()
        .skip(usize::from(lines.first().is_some_and(|line| line.len() != 18)))
        .map(|line| (line[..8].parse().expect("a number"), line[9..].parse().expect("a time")))
        .collect();
    assert!(lines.windows(2).all(|pair| pair[0].0 + 1 == pair[1].0), "lines are missing within the capture");
    Killed { lines: lines.len() as u64, lost_ms: lines.last().map(|(_, us)| 1e-3 * (killed_us - us)) }
}
