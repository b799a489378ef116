//! `slamd bench` writes what its head says, the same figures twice, and keeps what a person wrote below them.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_eval::bench::case::{Case, Table};
use slamd_eval::bench::fleet::drive_all;
use slamd_eval::bench::table::{accuracy_row, fault_rows};
use slamd_eval::bench::targets::targets;
use std::process::Command;

#[test]
fn drives_on_many_cores_are_those_of_one_and_their_figures_make_sense() {
    let cases: Vec<Case> = ["faults=late world=room", "faults=none sensors=8 world=furnished"]
        .into_iter()
        .flat_map(|text| {
            let choices: Vec<_> = text.split(' ').map(|choice| choice.parse().unwrap()).collect();
            Case::rows(None, &choices)
        })
        .map(|case| Case { seconds: 80.0, ..case })
        .collect();
    let together = drive_all(&cases, &[1, 2], |_, _| ()).unwrap();
    let alone = drive_all(&cases[1..], &[2], |_, _| ()).unwrap();
    let (one, other) = (&together[1][1], &alone[0][0]);
    assert_eq!((one.seed, one.accuracy, one.map), (2, other.accuracy, other.map));
    assert_eq!(one.detection, other.detection);

    let late = &together[0][0];
    assert!(late.sweeps_us.len() > 700 && late.path_m > 5.0 && late.odometry_ate_m > late.accuracy.ate_m, "{late:?}");
    let missing = &late.detection.kinds[1];
    assert_eq!((missing.faults, missing.latencies_s.len()), (2, 2), "{:?}", late.detection);
    // Two of 32 sensors of each kind for the last 20 s; 24 healthy throughout.
    assert!((missing.true_s - 40.0).abs() < 1.0, "{:?}", late.detection);
    assert!((late.detection.healthy_s - 24.0 * 79.6 - 8.0 * 59.6).abs() < 60.0, "{:?}", late.detection);
    assert!(late.nis > 0.1 && late.nis < 10.0 && late.nees > 0.01, "{} {}", late.nis, late.nees);
    let rows = accuracy_row(&cases[0], &together[0]) + &fault_rows(&cases[0], &together[0]);
    assert!(rows.starts_with("| room | cone | late | 32 | 1 |") && rows.contains("| stuck |"), "{rows}");
    assert!(targets(&cases, &together).contains("false alarms per sensor and hour | <= 1 |"));
}

#[test]
fn the_document_keeps_what_was_written_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("new/accuracy.md");
    let write = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.args(["bench", "accuracy", "world=room", "--seeds", "1-2", "--seconds", "20", "-v", "--out"]);
        let output = command.arg(&file).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("seed=2: ATE "), "a line about each drive");
        std::fs::read_to_string(&file).unwrap()
    };
    let first = write();
    assert!(first.contains("Written by `slamd bench accuracy world=room --seeds 1-2 --seconds 20 -v --out"), "{first}");
    std::fs::write(&file, first + "A shortfall explained.\n").unwrap();
    let second = write();
    assert!(second.ends_with("<!-- by hand -->\nA shortfall explained.\n"));
    assert_eq!(second.matches("## Targets").count(), 1, "{second}");
}

#[test]
fn what_cannot_be_driven_is_refused() {
    for arguments in [["world=moon", "--seeds=1"], ["beam=laser", "--seeds=1"], ["world=flat", "--seeds=9-3"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_slamd")).args(["bench", "accuracy"]).args(arguments).output();
        assert!(!output.unwrap().status.success(), "{arguments:?}");
    }
    assert!(Case::rows(Some(Table::Issue), &[]).iter().all(|case| case.load_world(1).is_ok()));
}
