//! `cargo bench --bench latency [-- --seconds 60]`: how late a pose is, and what the daemon takes of a core, on the real program at a
//! pseudo-terminal.
//!
//! From the return of the read that brought a sweep's last byte to the pose written and shown, as the daemon itself counts it in `summary.json`.
//! Loaded means one thread per core that does nothing but work. The board is a simulated one in haste: 20 sweeps a second.

mod options;

use slamd_testkit::mock_port::Terminal;
use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::player::play;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Until the axis is found and logged.
const SETTLE: Duration = Duration::from_secs(10);

struct Measured {
    summary: serde_json::Value,
    /// Share of one core.
    cpu: f64,
}

#[expect(clippy::disallowed_methods, reason = "a bench has a clock")]
fn measure(speed: u32, is_loaded: bool, options: &[&str], seconds: u64) -> Measured {
    let folder = tempfile::tempdir().expect("a folder");
    let terminal = Terminal::open();
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(&terminal.path).arg("--out").arg(folder.path()).args(options);
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    let (end, cores) = (AtomicBool::new(false), std::thread::available_parallelism().map_or(1, usize::from));
    let cpu = std::thread::scope(|scope| {
        scope.spawn(|| play(terminal, speed, &end));
        for _ in 0..if is_loaded { cores } else { 0 } {
            scope.spawn(|| {
                while !end.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let mut daemon = Daemon::run(command);
        daemon.expect("poses and map begin", Duration::from_secs(60));
        std::thread::sleep(SETTLE);
        let (before, begin) = (daemon.cpu_ticks(), Instant::now());
        std::thread::sleep(Duration::from_secs(seconds));
        let cpu = 0.01 * (daemon.cpu_ticks() - before) as f64 / begin.elapsed().as_secs_f64();
        daemon.end();
        end.store(true, Ordering::Relaxed);
        cpu
    });
    let text = std::fs::read_to_string(folder.path().join("summary.json")).expect("a summary");
    Measured { summary: serde_json::from_str(&text).expect("JSON"), cpu }
}

fn main() {
    let seconds: u64 = options::number("--seconds", 60);
    println!(
        "| sweeps a second | cores | | p50 ms | p99 ms | p99.9 ms | greatest ms | of one core | sweeps | frames lost |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let runs: [(u32, bool, &[&str]); 4] =
        [(1, false, &[]), (2, false, &[]), (2, true, &[]), (2, true, &["--realtime"])];
    for (speed, is_loaded, options) in runs {
        let Measured { summary, cpu } = measure(speed, is_loaded, options, seconds);
        let ms = |key: &str| summary["latency"][key].as_f64().unwrap_or(f64::NAN);
        println!(
            "| {} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} % | {} | {} |",
            10 * speed,
            if is_loaded { "loaded" } else { "free" },
            options.join(" "),
            ms("p50_ms"),
            ms("p99_ms"),
            ms("p999_ms"),
            ms("max_ms"),
            100.0 * cpu,
            summary["sweeps"],
            summary["lost_frames"],
        );
    }
}
