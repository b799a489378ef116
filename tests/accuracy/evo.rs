//! ATE and RPE agree with the `evo` package from PyPI (M. Grupp) on the TUM files of a replay, both aligned at the first pose.
//!
//! The test makes a Python environment in Cargo's target folder: it needs `python3` with `venv`, and PyPI the first time.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::source::replay::replay;
use slamd::source::session::Session;
use slamd_capture::CaptureReader;
use slamd_core::{Config, Pose2, Timestamp};
use slamd_metrics::{AccuracyMeter, Pairing, relative_error};
use slamd_testkit::python;
use slamd_testkit::python::run;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

const EVO: &str = "evo==1.38.1";
/// Sweeps of a step of the RPE: a second.
const STEP: usize = 10;

/// Reads a reference and an estimate and prints: ATE m, greatest m, heading RMSE degrees, RPE metres and degrees.
const SCRIPT: &str = r"
import sys
from evo.core import sync
from evo.core.metrics import APE, RPE, PoseRelation, Unit
from evo.tools.file_interface import read_tum_trajectory_file as read
reference, estimate = sync.associate_trajectories(read(sys.argv[1]), read(sys.argv[2]), max_diff=0.01)
estimate.align_origin(reference)
def statistics(metric):
    metric.process_data((reference, estimate))
    return metric.get_all_statistics()
position = statistics(APE(PoseRelation.translation_part))
step = dict(delta=int(sys.argv[3]), delta_unit=Unit.frames, all_pairs=False)
print(position['rmse'], position['max'], statistics(APE(PoseRelation.rotation_angle_deg))['rmse'],
      statistics(RPE(PoseRelation.translation_part, **step))['rmse'],
      statistics(RPE(PoseRelation.rotation_angle_deg, **step))['rmse'])
";

/// Python with evo.
fn python() -> PathBuf {
    python::python(env!("CARGO_TARGET_TMPDIR"), "evo", "evo", &[EVO])
}

/// What evo says of two files, in the order of [`SCRIPT`].
fn evo(python: &Path, reference: &Path, estimate: &Path) -> [f64; 5] {
    let mut command = Command::new(python);
    // evo keeps its settings in the home folder: not in the user's.
    command
        .env("HOME", python.parent().unwrap())
        .args(["-c", SCRIPT])
        .args([reference, estimate])
        .arg(STEP.to_string());
    let words = run(&mut command, "evo has failed");
    let numbers: Vec<f64> = words.split_whitespace().rev().take(5).map(|word| word.parse().unwrap()).collect();
    [numbers[4], numbers[3], numbers[2], numbers[1], numbers[0]]
}

/// The poses of a TUM file.
fn read(path: &Path) -> Vec<(Timestamp, Pose2)> {
    let pose = |line: &str| {
        let n: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let us = line.split(' ').next().unwrap().replace('.', "").parse().unwrap();
        (Timestamp::from_us(us), Pose2::new(n[1], n[2], 2.0 * libm::atan2(n[6], n[7])))
    };
    std::fs::read_to_string(path).unwrap().lines().map(pose).collect()
}

/// Our own figures of (estimated, true) pairs, in the order of [`SCRIPT`].
fn ours(pairs: &[(Pose2, Pose2)]) -> [f64; 5] {
    let mut meter = AccuracyMeter::default();
    pairs.iter().for_each(|&(estimate, truth)| meter.add(estimate, truth));
    let (whole, steps) = (meter.accuracy().unwrap(), relative_error(pairs, STEP).unwrap());
    [whole.ate_m, whole.ate_max_m, whole.heading_rmse_deg, steps.translation_rmse_m, steps.rotation_rmse_deg]
}

fn agree(ours: [f64; 5], theirs: [f64; 5]) {
    println!("ours {ours:.9?}\nevo  {theirs:.9?}");
    for (ours, theirs) in ours.iter().zip(theirs) {
        assert!((ours - theirs).abs() < 1e-6 * (1.0 + theirs), "{ours} {theirs}");
    }
}

/// Replays the committed capture; the ATE in metres that the summary states, and the poses in `folder`.
fn drive(folder: &Path) -> f64 {
    let capture = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let mut capture = CaptureReader::open(&capture).unwrap();
    let config = Config::from_toml(&capture.info().config_toml).unwrap();
    let mut session = Session::new(slamd_paper::pipeline(&config, slamd_core::Start::Fresh).unwrap(), folder).unwrap();
    replay(&mut capture, &mut session, |_| ()).unwrap();
    session.finish().unwrap().0.accuracy.unwrap().ate_m
}

#[test]
fn ate_and_rpe_are_those_of_evo() {
    let folder = tempfile::tempdir().unwrap();
    let stated_m = drive(folder.path());
    let [truth_file, estimate_file] = ["truth.tum", "trajectory.tum"].map(|name| folder.path().join(name));
    let (truth, estimate) = (read(&truth_file), read(&estimate_file));
    let python = python();

    // The files as they are, each estimate with the nearest truth within 10 ms, as evo has it.
    let nearest = |at: Timestamp| *truth.iter().min_by_key(|(time, _)| time.us().abs_diff(at.us())).unwrap();
    let pairs = estimate.iter().map(|&(at, pose)| (at, pose, nearest(at)));
    let near = pairs.filter(|(at, _, (time, _))| time.us().abs_diff(at.us()) <= 10_000);
    let pairs: Vec<(Pose2, Pose2)> = near.map(|(_, estimate, (_, truth))| (estimate, truth)).collect();
    assert!(pairs.len() > 2_300);
    agree(ours(&pairs), evo(&python, &truth_file, &estimate_file));

    // The truth interpolated to the estimates' times, as in the summary: evo finds both at the same instant.
    let (mut pairing, mut pairs, mut lines) = (Pairing::default(), Vec::new(), String::new());
    truth.into_iter().for_each(|(at, pose)| pairing.truth(at, pose));
    estimate.into_iter().for_each(|(at, pose)| pairing.estimate(at, pose));
    while let Some(pair) = pairing.next_pair() {
        pairs.push((pair.estimate, pair.truth));
        let (qz, qw) = libm::sincos(0.5 * pair.truth.theta_rad);
        let at = format!("{}.{:06}", pair.at.us() / 1_000_000, pair.at.us() % 1_000_000);
        writeln!(lines, "{at} {:.9} {:.9} 0 0 0 {qz:.12} {qw:.12}", pair.truth.x_m, pair.truth.y_m).unwrap();
    }
    let interpolated = folder.path().join("interpolated.tum");
    std::fs::write(&interpolated, lines).unwrap();
    let ours = ours(&pairs);
    agree(ours, evo(&python, &interpolated, &estimate_file));
    assert!((ours[0] - stated_m).abs() < 1e-5, "{ours:?} {stated_m}");
}
