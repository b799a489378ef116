//! `cargo bench --bench viewer [-- --speed 20]`: what it costs to be watched, on the committed capture.
//!
//! The capture is played some times as fast as it was recorded, to a session of each kind in turn: unwatched, recorded, served with nobody
//! there, and connected to something that accepts and never reads. Each is played twice, and the better figure counts: the machine does
//! other things, too. That is also why processor time is shown beside the time that passes, which on a busy machine says little.

mod options;

use rustix::time::{ClockId, clock_gettime};
use slamd::source::replay::step;
use slamd::source::session::Session;
use slamd_capture::CaptureReader;
use slamd_core::Config;
use slamd_testkit::haste::Haste;
use slamd_viewer::{Identity, Viewer};
use std::cell::Cell;
use std::net::TcpListener;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Unwatched,
    Recorded,
    /// Recorded, by a robot that fires and drives twice as fast.
    RecordedInHaste,
    Served,
    Wedged,
}

/// Seconds of one sweep each, or per sweep.
struct Cost {
    sweeps: Vec<f64>,
    pipeline_cpu: Vec<f64>,
    tap: f64,
    /// All other threads.
    others_cpu: f64,
    bytes_per_s: f64,
    dropped: u64,
}

fn cpu_s(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// What it takes to look at the clock, which is more than the tap takes most of the time.
fn clock_s() -> f64 {
    const LOOKS: u32 = 10_000;
    let begin = cpu_s(ClockId::ThreadCPUTime);
    for _ in 0..LOOKS {
        std::hint::black_box(cpu_s(ClockId::ThreadCPUTime));
    }
    (cpu_s(ClockId::ThreadCPUTime) - begin) / f64::from(LOOKS)
}

fn p99(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() * 99 / 100]
}

#[expect(clippy::disallowed_methods, reason = "a bench has a clock")]
fn play(kind: Kind, speed: f64) -> Cost {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("drive.rrd");
    let deaf = TcpListener::bind("127.0.0.1:0").expect("a port");
    let host = deaf.local_addr().expect("its address").to_string();
    let identity = Identity { recording: format!("bench-{host}"), name: "bench".into(), unix_zero_us: None };
    let mut viewer = Viewer::new(identity, false);
    match kind {
        Kind::Unwatched => {}
        Kind::Recorded | Kind::RecordedInHaste => viewer.record(&file).expect("a file"),
        Kind::Served => {
            let free = TcpListener::bind("127.0.0.1:0").and_then(|port| port.local_addr()).expect("a port");
            assert!(viewer.serve(free));
        }
        Kind::Wedged => viewer.connect(&format!("rerun+http://{host}/proxy"), &host),
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let mut capture = CaptureReader::open(&path).expect("the committed capture");
    let config = Config::from_toml(&capture.info().config_toml).expect("its configuration");
    let mut session = Session::new(
        slamd_paper::pipeline(&config, slamd_core::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused"),
        &folder.path().join("out"),
    )
    .expect("a session");
    let (tapped, clock_s) = (Rc::new(Cell::new(0.0)), clock_s());
    if let Some(mut tap) = viewer.tap() {
        let tapped = Rc::clone(&tapped);
        session.watch(Box::new(move |scene, sight| {
            let begin = cpu_s(ClockId::ThreadCPUTime);
            tap.see(scene, sight);
            tapped.set(tapped.get() + cpu_s(ClockId::ThreadCPUTime) - begin - clock_s);
        }));
    }
    let (begin, process) = (Instant::now(), cpu_s(ClockId::ProcessCPUTime));
    let main = cpu_s(ClockId::ThreadCPUTime);
    let (mut sweeps, mut pipeline_cpu, mut seconds) = (Vec::new(), Vec::new(), 0.0);
    let mut haste = (kind == Kind::RecordedInHaste).then(Haste::default);
    for record in &mut capture {
        let record = record.expect("it is whole");
        let record = match &mut haste {
            Some(haste) => haste.halve(record),
            None => Some(record),
        };
        let Some(record) = record else { continue };
        seconds = record.at().seconds();
        let due = begin + Duration::from_secs_f64(seconds / speed);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let before = session.pipeline().counters().sweeps;
        let (wall, cpu) = (Instant::now(), cpu_s(ClockId::ThreadCPUTime));
        step(&mut session, &record).expect("outputs can be written");
        if session.pipeline().counters().sweeps > before {
            sweeps.push(wall.elapsed().as_secs_f64());
            pipeline_cpu.push(cpu_s(ClockId::ThreadCPUTime) - cpu);
        }
    }
    let main = cpu_s(ClockId::ThreadCPUTime) - main;
    let others = cpu_s(ClockId::ProcessCPUTime) - process - main;
    drop(session);
    let dropped = viewer.dropped();
    viewer.finish(Duration::from_secs(5));
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    let count = sweeps.len() as f64;
    let (tap, bytes_per_s) = (tapped.get() / count, bytes as f64 / seconds);
    Cost { sweeps, pipeline_cpu, tap, others_cpu: others / count, bytes_per_s, dropped }
}

fn main() {
    let speed: f64 = options::number("--speed", 20.0);
    let kinds = [
        ("unwatched", Kind::Unwatched),
        ("recorded", Kind::Recorded),
        ("served, nobody there", Kind::Served),
        ("connected, never read", Kind::Wedged),
    ];
    let first = kinds.map(|(_, kind)| play(kind, speed));
    let second = kinds.map(|(_, kind)| play(kind, speed));
    println!("us per sweep, the capture at {speed} x its speed:\n");
    println!(
        "| | tap, CPU, mean | viewer's threads, mean | sweep, p99 | to unwatched | CPU of it, p99 | to unwatched | dropped |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let best = |at: usize, values: fn(&Cost) -> &[f64]| p99(values(&first[at])).min(p99(values(&second[at])));
    for (at, (name, _)) in kinds.iter().enumerate() {
        let [wall, cpu]: [fn(&Cost) -> &[f64]; 2] = [|cost| &cost.sweeps, |cost| &cost.pipeline_cpu];
        let (wall_s, cpu_s) = (best(at, wall), best(at, cpu));
        println!(
            "| {name} | {:.2} | {:.0} | {:.0} | {:.3} | {:.0} | {:.3} | {} |",
            1e6 * first[at].tap.min(second[at].tap),
            1e6 * first[at].others_cpu.min(second[at].others_cpu),
            1e6 * wall_s,
            wall_s / best(0, wall),
            1e6 * cpu_s,
            cpu_s / best(0, cpu),
            second[at].dropped,
        );
    }
    let (ten, twenty) = (first[1].bytes_per_s, play(Kind::RecordedInHaste, speed).bytes_per_s);
    println!("\nfile: {:.1} kB/s at 10 sweeps a second, {:.1} at 20", 1e-3 * ten, 1e-3 * twenty);
    for (at, (name, _)) in kinds.iter().enumerate() {
        let ratio = best(at, |cost| &cost.pipeline_cpu) / best(0, |cost| &cost.pipeline_cpu);
        let tap_s = first[at].tap.min(second[at].tap);
        assert!(tap_s < 5e-6, "{name}: the pipeline's thread pays {:.1} us per sweep", 1e6 * tap_s);
        assert!(ratio < 1.1, "{name}: the 99th percentile is {ratio} times the unwatched one");
    }
}
