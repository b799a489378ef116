//! The fleet's player gets what slamd itself gets of a capture, bit for bit.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod drives;

use drives::{Drive, play};
use slamd_capture::CaptureReader;
use slamd_core::{Config, Driver};
use slamd_fleet::player::{Player, Report};
use slamd_publish::write_map;
use std::fs::File;
use std::path::Path;

fn slamds_own(path: &Path, out: &Path) -> Vec<u8> {
    let mut capture = CaptureReader::open(path).unwrap();
    let config = Config::from_toml(&capture.info().config_toml).unwrap();
    let pipeline = slamd_paper::pipeline(&config, slamd_core::Start::Fresh).unwrap();
    let mut driver = Driver::new(pipeline);
    for record in &mut capture {
        driver.feed(&record.unwrap(), |_, _| {});
    }
    driver.end(|_, _| {});
    std::fs::create_dir_all(out).unwrap();
    write_map(out, "map", &driver.pipeline().raster()).unwrap();
    std::fs::read(out.join("map.pgm")).unwrap()
}

#[test]
fn the_map_is_slamds_own() {
    let folder = tempfile::tempdir().unwrap();
    let simulated = folder.path().join("simulated.mcap");
    Drive { world: "flat", seed: 4, seconds: 40.0, at: None }.write(&simulated);
    // With a handshake, clock questions and a board of its own.
    let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../replay/flat-emulated-mega.mcap");
    for (place, path) in [simulated, committed].iter().enumerate() {
        let out = folder.path().join(format!("out-{place}"));
        let expected = slamds_own(path, &out);
        write_map(&out, "fleet", &play(path).occupancy().unwrap().raster()).unwrap();
        assert!(std::fs::read(out.join("fleet.pgm")).unwrap() == expected, "{}", path.display());
    }
}

#[test]
fn a_capture_read_in_any_pieces_brings_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    Drive { world: "flat", seed: 5, seconds: 20.0, at: None }.write(&path);
    let reports = |chunk: usize| {
        let file = std::io::BufReader::with_capacity(chunk, File::open(&path).unwrap());
        let mut player = Player::begin(file, &path).unwrap();
        let mut reports = Vec::new();
        player.finish(|report| reports.push(format!("{report:?}"))).unwrap();
        (reports, player.grid().unwrap())
    };
    let (whole, grid) = reports(1 << 20);
    assert!((whole.clone(), grid) == reports(13));
    let poses = whole.iter().filter(|report| report.starts_with("Pose")).count();
    assert!(poses > 150, "{poses} poses");
}

#[test]
fn poses_and_sweeps_are_numbered_alike() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    Drive { world: "flat", seed: 6, seconds: 20.0, at: None }.write(&path);
    let mut player = Player::begin(File::open(&path).unwrap(), &path).unwrap();
    let (mut poses, mut sweeps) = (Vec::new(), Vec::new());
    player
        .finish(|report| match report {
            Report::Pose(pose) => poses.push(pose.seq),
            Report::Sweep(sweep) => sweeps.push(sweep.seq),
        })
        .unwrap();
    assert_eq!(poses, sweeps);
    assert!(poses.windows(2).all(|pair| pair[0] < pair[1]));
}
