//! `cargo bench --no-default-features --bench performance`: runs the other benches and writes `docs/performance.md` from what they say.
//!
//! `-- --accept` instead counts instructions only and accepts them: it writes `benches/instructions.toml`, the gate in CI.
//! `-- --hours 100 --seconds 60 --out docs` are the growth bench's hours, the latency bench's seconds, and where to write.

mod options;
mod workload;

use slamd_core::Method;
use slamd_eval::bench::machine;
use slamd_eval::bench::report::{BY_HAND, by_hand};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use workload::{CAPTURES, Drive};

/// Milliseconds per scan of others: the first from the paper (2.6 GHz Core i7), the others run on 32 point beams of a simulated drive
/// of 49 m, on two such cores as these. Mean, and 99th percentile where it was measured.
const PEERS: [(&str, f64, Option<f64>); 4] = [
    ("the paper's figure for its own method", 2.95, None),
    ("vinySLAM", 0.109, None),
    ("GMapping, 30 particles", 0.59, Some(8.1)),
    ("LaMa", 0.005, None),
];
/// What the paper reached: its own time as a part of vinySLAM's.
const PAPER_PART: f64 = 0.1993;
/// Every stage of the instruction bench runs on this capture, but for the pipeline with faults.
const STAGES_ON: &str = CAPTURES[1];

/// What another bench prints. A gate that fails is seen on its standard error.
fn bench(name: &str, arguments: &[&str]) -> String {
    eprintln!("cargo bench --bench {name} -- {}", arguments.join(" "));
    let mut command = Command::new(env!("CARGO"));
    command.args(["bench", "--no-default-features", "--bench", name, "--"]).args(arguments);
    let output = command.stderr(Stdio::inherit()).output().expect("cargo runs");
    String::from_utf8(output.stdout).expect("text")
}

/// Instructions per capture, by bench.
fn instructions() -> Vec<(String, u64)> {
    let text = bench("instructions", &["--output-format=json"]);
    let counted = |line: &str| {
        let json: serde_json::Value = serde_json::from_str(line).ok()?;
        let (function, id) = (json["function_name"].as_str()?, json["id"].as_str()?);
        let name = if function == "pipeline" { format!("{function}_{id}") } else { function.to_owned() };
        Some((name, json["profiles"][0]["data"]["total"]["metrics"]["Ir"]["values"]["new"].as_u64()?))
    };
    let counted: Vec<_> = text.lines().filter_map(counted).collect();
    assert!(!counted.is_empty(), "the instruction bench says nothing: are valgrind and gungraun-runner there?");
    counted
}

fn accept(path: &Path) {
    let mut text = String::from(
        "# Instructions per committed capture, as accepted. Written by `cargo bench --bench performance -- --accept`.\n",
    );
    for (name, count) in instructions() {
        let _ = writeln!(text, "{name} = {count}");
    }
    std::fs::write(path, text).expect("benches/ can be written");
    println!("{}", path.display());
}

/// Microseconds per capture, by criterion's names.
fn times(sweeps: &BTreeMap<&str, u64>) -> String {
    bench("stages", &[]);
    let target = std::env::var("CARGO_TARGET_DIR").unwrap_or_else(|_| "target".into());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(target).join("criterion");
    let mut text = String::from("| | us per sweep |\n|---|---|\n");
    for (group, names) in [
        ("stages", &["read", "decode", "align", "pca", "faults", "hough", "ekf", "grid", "publish"][..]),
        ("pipeline", &["walls", "mega", "paper"]),
    ] {
        for name in names {
            let file = root.join(group).join(name).join("new/estimates.json");
            let json = std::fs::read_to_string(&file).expect("criterion has written it");
            let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
            let ns = json["median"]["point_estimate"].as_f64().unwrap_or(f64::NAN);
            let capture = if *name == "mega" { CAPTURES[1] } else { CAPTURES[0] };
            let _ = writeln!(text, "| {group}: {name} | {:.2} |", 1e-3 * ns / sweeps[capture] as f64);
        }
    }
    text
}

/// Mean and 99th percentile of the default method, and how they compare, from a replay of the program itself.
fn peers() -> String {
    let (summary, speed) = replay();
    let ms = |key: &str| 1e-3 * summary[key].as_f64().unwrap_or(f64::NAN);
    let (mean_ms, p99_ms) = (ms("mean_us_per_sweep"), ms("p99_us_per_sweep"));
    let mut text =
        String::from("| | mean ms | p99 ms | slamd's mean to it | slamd's p99 to it |\n|---|---|---|---|---|\n");
    let _ = writeln!(text, "| **slamd**, `walls` | {mean_ms:.4} | {p99_ms:.4} | 1 | 1 |");
    for (name, peer_ms, peer_p99_ms) in PEERS {
        let (p99, ratio) = peer_p99_ms.map_or_else(
            || ("-".into(), "-".into()),
            |peer_ms| (format!("{peer_ms}"), format!("1 / {:.1}", peer_ms / p99_ms)),
        );
        let _ = writeln!(text, "| {name} | {peer_ms} | {p99} | {:.3} | {ratio} |", mean_ms / peer_ms);
    }
    let part = 100.0 * mean_ms / PEERS[1].1;
    let _ = writeln!(text, "\n{part:.1} % of vinySLAM's time; the paper's claim is {:.2} %.\n", 100.0 * PAPER_PART);
    let _ = writeln!(
        text,
        "Replay of the whole program, with all its files: {speed:.0} x real time on one core (wanted: 3,000)."
    );
    text
}

/// The best of three replays of the longer capture: its summary and how many times as fast as it was recorded.
fn replay() -> (serde_json::Value, f64) {
    let captures = tempfile::tempdir().expect("a folder");
    let name = format!("{}.mcap", CAPTURES[0]);
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay").join(&name);
    std::fs::copy(from, captures.path().join(&name)).expect("a committed capture");
    let run = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.arg("replay").arg(captures.path()).args(["--jobs", "1", "--json", "--out"]).arg(captures.path());
        let output = command.stderr(Stdio::null()).output().expect("slamd runs");
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let row = json[0].clone();
        let speed = row["duration_s"].as_f64().unwrap_or(0.0) / row["elapsed_s"].as_f64().unwrap_or(f64::NAN);
        (row["summary"].clone(), speed)
    };
    [run(), run(), run()].into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("three runs")
}

/// Megabytes that a replay of a committed capture holds half way and at most.
fn resident() -> String {
    let mut text =
        String::from("| replayed | resident MiB, half way | at most, while the picture is drawn |\n|---|---|---|\n");
    for capture in CAPTURES {
        let out = tempfile::tempdir().expect("a folder");
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay").join(capture).with_extension("mcap");
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.arg("replay").arg(file).arg("--out").arg(out.path()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.spawn().expect("slamd runs");
        let status = format!("/proc/{}/status", child.id());
        let (mut held_kib, mut peak_kib) = (Vec::new(), 0.0_f64);
        while child.try_wait().expect("it was started").is_none() {
            let text = std::fs::read_to_string(&status).unwrap_or_default();
            let kib = |key: &str| -> Option<f64> {
                let line = text.lines().find_map(|line| line.strip_prefix(key))?;
                line.split_whitespace().next()?.parse().ok()
            };
            held_kib.extend(kib("VmRSS:"));
            peak_kib = peak_kib.max(kib("VmHWM:").unwrap_or(0.0));
        }
        let half_way_kib = held_kib.get(held_kib.len() / 2).copied().unwrap_or(f64::NAN);
        let _ = writeln!(text, "| {capture} | {:.1} | {:.1} |", half_way_kib / 1024.0, peak_kib / 1024.0);
    }
    text
}

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    if options::has("--accept") {
        return accept(&root.join("benches/instructions.toml"));
    }
    let out = root.join(options::text("--out", "docs"));
    let hours = options::text("--hours", "10");
    let seconds = options::text("--seconds", "60");
    let sweeps: BTreeMap<&str, u64> = CAPTURES.map(|name| (name, Drive::load(name, Method::Walls).sweeps())).into();
    let mut counts = String::from("| | instructions per sweep |\n|---|---|\n");
    for (name, count) in instructions() {
        let capture = if name == "pipeline_faults" { CAPTURES[0] } else { STAGES_ON };
        let _ = writeln!(counts, "| {name} | {} |", count / sweeps[capture].max(1));
    }
    let text = format!(
        "# Performance\n\nWritten by `cargo bench --no-default-features --bench performance -- --hours {hours} --seconds {seconds}`, but for what follows the line \"<!-- by hand -->\", on {}, two cores that other \
         programs use, too: times scatter by a tenth, instructions do not.\n\n## Against others\n\n{}\n## Instructions\n\nCounted by valgrind over \
         the committed captures (`cargo bench --bench instructions`), the gate in CI: 5 % more than `benches/instructions.toml` fails. Stages run \
         alone, on every sweep; in the pipeline the axis is sought only while the heading is in doubt, and a beam clears its cone in one sweep of \
         eight.\n\n{counts}\n## Times\n\n{}\n## Latency\n\nFrom the last byte read to the pose written and shown, at a pseudo-terminal (`cargo bench --bench \
         latency`). The greatest is of the beginning: the axis is found, and the way back through the first sweeps is taken at once.\n\n{}\n## SavedState\n\n{}\n## \
         Growth\n\nLaps through buildings of corridors (`cargo bench --bench growth`).\n\n![Time of a sweep and heap over hours](growth.png)\n{}",
        machine::cpu(),
        peers(),
        times(&sweeps),
        bench("latency", &["--seconds", &seconds]),
        resident(),
        bench("growth", &["--hours", &hours, "--out", &out.display().to_string()]),
    );
    let file = out.join("performance.md");
    let before = std::fs::read_to_string(&file).unwrap_or_default();
    std::fs::write(file, format!("{text}\n{BY_HAND}\n{}", by_hand(&before))).expect("the folder can be written");
}
