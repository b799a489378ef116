//! `cargo bench --bench growth [-- --hours 100 --out docs]`: does a sweep cost the same after 100 hours, and in a square kilometre?
//!
//! Laps through three buildings of corridors ([`lattice`]), through the whole pipeline from the board's bytes on. Each line of the table is a tenth
//! of the hours asked for. Draws `growth.png` into `--out`. Heap is what the pipeline itself has allocated and not given back.

mod options;

use allocation_counter::measure;
use hdrhistogram::Histogram;
use indicatif::ProgressBar;
use slamd_core::{Input, Pipeline, Point};
use slamd_eval::plot::{Curve, Plot, to_png};
use slamd_testkit::lattice::{Drive, Plan, drain};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// Name, building, and whether 100 hours are driven in it: in the others a lap takes long enough.
const BUILDINGS: [(&str, Plan); 3] = [
    ("100 m2", Plan { lines: 2, pitch_m: 7.5 }),
    ("10,000 m2", Plan { lines: 20, pitch_m: 5.0 }),
    ("1 km2, sparse", Plan { lines: 10, pitch_m: 110.0 }),
];
const INKS: [[u8; 3]; 3] = [[30, 90, 200], [200, 80, 20], [40, 140, 60]];
const SWEEPS_PER_HOUR: f64 = 36_000.0;
const PARTS: u32 = 10;

/// A tenth of a drive.
struct Part {
    hours: f64,
    mean_us: f64,
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
    heap_bytes: i64,
    bytes_per_sweep: f64,
    poses: u64,
}

#[expect(clippy::disallowed_methods, reason = "a bench has a clock")]
fn part(drive: &mut Drive, sweeps: u64, hours: f64, heap_bytes: i64) -> Part {
    let mut times = Histogram::<u64>::new_with_bounds(1, 60_000_000_000, 3).expect("bounds");
    let (mut churned, mut heap, mut poses) = (0, heap_bytes, 0);
    for _ in 0..sweeps {
        let mut elapsed_ns = 0;
        let mut handle = |pipeline: &mut Pipeline, input: Input<'_>| {
            let mut transmit = Vec::new();
            let begin = Instant::now();
            let info = measure(|| {
                pipeline.handle(input);
                transmit = drain(pipeline, &mut poses);
            });
            elapsed_ns += u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX);
            churned += info.bytes_total;
            transmit
        };
        // What is handed to the board is freed outside the pipeline, but within the sweep.
        heap += measure(|| drive.sweep(&mut handle)).bytes_current;
        times.saturating_record(elapsed_ns);
    }
    let us = |ns: u64| 1e-3 * ns as f64;
    Part {
        hours,
        mean_us: 1e-3 * times.mean(),
        p50_us: us(times.value_at_quantile(0.5)),
        p99_us: us(times.value_at_quantile(0.99)),
        max_us: us(times.max()),
        heap_bytes: heap,
        bytes_per_sweep: churned as f64 / sweeps as f64,
        poses,
    }
}

/// Cells of the map that something is known of, square metres.
fn explored_m2(drive: &Drive) -> f64 {
    let Some(memory) = drive.pipeline.saved_state() else { return 0.0 };
    let known = memory.map.tiles.iter().flat_map(|tile| &tile.log_odds).filter(|value| **value != 0).count();
    known as f64 * memory.map.cell_m * memory.map.cell_m
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sweeps of a drive")]
fn run(plan: Plan, hours: f64, bar: &ProgressBar) -> (Vec<Part>, f64, Drive) {
    let mut drive = Drive::new(plan, hours);
    let sweeps = (hours * SWEEPS_PER_HOUR / f64::from(PARTS)) as u64;
    let mut parts: Vec<Part> = Vec::new();
    for tenth in 1..=PARTS {
        let heap = parts.last().map_or(0, |part| part.heap_bytes);
        parts.push(part(&mut drive, sweeps, hours * f64::from(tenth) / f64::from(PARTS), heap));
        bar.inc(1);
    }
    let explored = explored_m2(&drive);
    (parts, explored, drive)
}

fn main() {
    let hours: f64 = options::number("--hours", 10.0);
    let bar = ProgressBar::new(3 * u64::from(PARTS));
    let (mut text, mut times, mut heaps) = (String::new(), Vec::new(), Vec::new());
    for ((name, plan), rgb) in BUILDINGS.into_iter().zip(INKS) {
        let (parts, explored_m2, drive) = run(plan, hours, &bar);
        let (lap_h, counters) = (drive.lap_h(), drive.pipeline.counters());
        let _ = writeln!(
            text,
            "\n**{name}**: a lap takes {lap_h:.2} h; {explored_m2:.0} m2 explored, {} sweeps, {} dropped, {} frames lost\n",
            counters.sweeps, counters.dropped_sweeps, counters.lost_frames
        );
        let _ = writeln!(
            text,
            "| hours | mean us | p50 us | p99 us | greatest us | heap KiB | allocated bytes per sweep | poses |"
        );
        let _ = writeln!(text, "|---|---|---|---|---|---|---|---|");
        for part in &parts {
            let _ = writeln!(
                text,
                "| {:.1} | {:.1} | {:.1} | {:.1} | {:.0} | {:.0} | {:.1} | {} |",
                part.hours,
                part.mean_us,
                part.p50_us,
                part.p99_us,
                part.max_us,
                part.heap_bytes as f64 / 1024.0,
                part.bytes_per_sweep,
                part.poses
            );
        }
        let heap = parts.last().map_or(0, |part| part.heap_bytes) as f64;
        let _ = writeln!(text, "\n{:.0} bytes of heap per explored m2", heap / explored_m2.max(1.0));
        let points = |of: fn(&Part) -> f64| parts.iter().map(|part| Point::new(part.hours, of(part))).collect();
        let curve = |points| Curve { name, rgb, is_dashed: false, points };
        times.push(curve(points(|part| part.p50_us)));
        heaps.push(curve(points(|part| part.heap_bytes as f64 / 1_048_576.0)));
    }
    bar.finish_and_clear();
    println!("{text}");
    if options::has("--out") {
        let folder = options::text("--out", "");
        let plot = |title: &str, y_label, curves| Plot {
            title: title.into(),
            x_label: "time [h]",
            y_label,
            curves,
            ..Plot::default()
        };
        let plots = [
            plot("Median time of a sweep", "time of a sweep [us]", times),
            plot("Heap of the pipeline", "heap [MiB]", heaps),
        ];
        let picture = to_png(&plots).expect("a picture");
        std::fs::write(Path::new(&folder).join("growth.png"), picture).expect("the folder can be written");
    }
}
