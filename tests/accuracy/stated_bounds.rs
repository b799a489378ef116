//! What a run says of its own position is right: in simulated homes the true position lies within `position_within_m` of `summary.json`.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::process::Command;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");

fn slamd(folder: &Path, line: &str) {
    let output = Command::new(SLAMD).args(line.split(' ')).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Time and pose of each line of a TUM trajectory.
fn poses(path: &Path) -> Vec<(f64, [f64; 3])> {
    let line = |line: &str| {
        let fields: Vec<f64> = line.split(' ').map(|field| field.parse().unwrap()).collect();
        (fields[0], [fields[1], fields[2], 2.0 * libm::atan2(fields[6], fields[7])])
    };
    std::fs::read_to_string(path).unwrap().lines().map(line).collect()
}

/// A pose seen from another one.
fn from(origin: [f64; 3], pose: [f64; 3]) -> [f64; 2] {
    let (sin, cos) = libm::sincos(origin[2]);
    let (x, y) = (pose[0] - origin[0], pose[1] - origin[1]);
    [cos * x + sin * y, cos * y - sin * x]
}

#[test]
fn the_stated_bound_holds_in_simulated_homes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let (mut held, mut all, mut ends, mut certain) = (0, 0, 0, 0);
    let homes = [(101, 8), (102, 16), (103, 32), (104, 16), (105, 8), (106, 32)];
    for (seed, sensors) in homes {
        slamd(
            here,
            &format!("simulate --world random --seed {seed} --sensors {sensors} --duration 70 --capture {seed}.mcap"),
        );
        slamd(here, &format!("replay {seed}.mcap --out {seed}"));
        let out = here.join(seed.to_string());
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
        if summary["uncertain_s"].as_f64().unwrap() > 0.0 {
            continue;
        }
        let bound_m = |index: usize| summary["position_within_m"][index].as_f64().unwrap();
        let (path, truth) = (poses(&out.join("trajectory.tum")), poses(&out.join("truth.tum")));
        let at = |t_s: f64| truth[truth.partition_point(|(at_s, _)| *at_s < t_s).min(truth.len() - 1)].1;
        let (first, first_truth) = (path[0].1, at(path[0].0));
        let errors: Vec<f64> = path
            .iter()
            .map(|(t_s, pose)| {
                let (found, true_one) = (from(first, *pose), from(first_truth, at(*t_s)));
                libm::hypot(found[0] - true_one[0], found[1] - true_one[1])
            })
            .collect();
        let within = errors.iter().filter(|error_m| **error_m <= bound_m(1)).count();
        println!(
            "seed {seed}, {sensors} sensors: greatest error {:.3} m, stated {:.3} m; at the end {:.3} m, stated {:.3} m",
            errors.iter().copied().fold(0.0, f64::max),
            bound_m(1),
            errors[errors.len() - 1],
            bound_m(0)
        );
        (held, all, certain) = (held + within, all + errors.len(), certain + 1);
        ends += usize::from(errors[errors.len() - 1] <= bound_m(0));
        // A bound that says nothing would hold, too.
        assert!(bound_m(1) < 0.5, "seed {seed}: {} m", bound_m(1));
    }
    assert!(certain >= 4, "most drives must be certain: {certain} of {}", homes.len());
    assert!(held as f64 >= 0.95 * all as f64, "{held} of {all} poses lie within the bound");
    assert!(ends + 1 >= certain, "{ends} of {certain} drives end within the bound");
}
