//! `cargo bench --bench stages`: the time of each stage, and of the whole pipeline, over a committed capture.
//!
//! Times are those of a whole capture; the throughput counts its sweeps. A busy machine shows: `--bench instructions` is the one that judges.

mod workload;

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use slamd_core::Method;
use std::hint::black_box;
use std::time::Duration;
use workload::{CAPTURES, Drive};

fn stages(criterion: &mut Criterion) {
    let drive = Drive::load(CAPTURES[0], Method::Walls);
    let mut group = criterion.benchmark_group("stages");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).measurement_time(Duration::from_secs(2));
    group.throughput(Throughput::Elements(drive.sweeps()));
    group.bench_function("read", |bencher| bencher.iter(|| black_box(&drive).read(CAPTURES[0])));
    group.bench_function("decode", |bencher| bencher.iter(|| black_box(&drive).decode()));
    group.bench_function("align", |bencher| bencher.iter(|| black_box(&drive).align()));
    group.bench_function("pca", |bencher| bencher.iter(|| black_box(&drive).pca()));
    group.bench_function("faults", |bencher| bencher.iter(|| black_box(&drive).faults()));
    group.bench_function("hough", |bencher| bencher.iter(|| black_box(&drive).hough()));
    group.bench_function("ekf", |bencher| bencher.iter(|| black_box(&drive).ekf()));
    group.bench_function("grid", |bencher| bencher.iter(|| black_box(&drive).grid()));
    group.bench_function("publish", |bencher| bencher.iter(|| black_box(&drive).publish()));
    group.finish();
}

fn pipeline(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("pipeline");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).measurement_time(Duration::from_secs(3));
    let runs = [
        ("walls", CAPTURES[0], Method::Walls),
        ("mega", CAPTURES[1], Method::Walls),
        ("paper", CAPTURES[0], Method::Paper),
    ];
    for (name, capture, method) in runs {
        let drive = Drive::load(capture, method);
        group.throughput(Throughput::Elements(drive.sweeps()));
        group.bench_function(name, |bencher| bencher.iter(|| black_box(&drive).pipeline()));
    }
    group.finish();
}

criterion_group!(benches, stages, pipeline);
criterion_main!(benches);
