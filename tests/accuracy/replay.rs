//! The committed capture with the paper's eight faults, by both methods: the table of the README.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::source::replay::replay;
use slamd::source::session::Session;
use slamd_capture::CaptureReader;
use slamd_core::{Config, Method};
use slamd_publish::Summary;
use std::path::Path;

fn run(method: Method) -> Summary {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let folder = tempfile::tempdir().unwrap();
    let mut capture = CaptureReader::open(&path).unwrap();
    let config = Config { method, ..Config::from_toml(&capture.info().config_toml).unwrap() };
    let faults = capture.info().faults.clone().unwrap_or_default();
    let mut session =
        Session::new(slamd_paper::pipeline(&config, slamd_core::Start::Fresh).unwrap(), folder.path()).unwrap();
    session.true_faults(faults.iter().map(|fault| fault.parse().unwrap()).collect());
    replay(&mut capture, &mut session, |_| ()).unwrap();
    assert_eq!(capture.damage(), None);
    let (summary, _) = session.finish().unwrap();
    for file in
        ["map.pgm", "map.yaml", "map.png", "trajectory.tum", "odometry.tum", "truth.tum", "faults.csv", "summary.json"]
    {
        assert!(folder.path().join(file).metadata().unwrap().len() > 0, "{file}");
    }
    summary
}

#[test]
fn walls_keep_within_twenty_centimetres_and_find_the_faults() {
    let summary = run(Method::Walls);
    let accuracy = summary.accuracy.unwrap();
    let faults = summary.faults.unwrap();
    println!("walls: {accuracy:?} {faults:?}");
    assert!(summary.sweeps > 2_300 && summary.dropped == 0 && summary.crc_errors == 0);
    assert!(accuracy.ate_m <= 0.20, "{accuracy:?}");
    assert!(faults.fault_precision.unwrap() > 0.9 && faults.fault_recall.unwrap() > 0.9, "{faults:?}");
    // Twice the same, bit for bit.
    assert_eq!(summary.trajectory_sha256, run(Method::Walls).trajectory_sha256);
}

#[test]
fn the_paper_runs_and_is_measured() {
    let summary = run(Method::Paper);
    println!("paper: {:?} {:?}", summary.accuracy.unwrap(), summary.faults.unwrap());
    assert!(summary.sweeps > 2_300);
    assert!(summary.accuracy.unwrap().ate_m.is_finite());
}
