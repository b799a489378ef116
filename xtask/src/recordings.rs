//! `cargo xtask recordings`: the errors of the default method on recordings of real robots that are not part of the project.

mod measure;

use measure::{Failure, Figures};
use slamd_core::stages::Params;
use std::path::PathBuf;

/// Errors on recordings of real robots: 17 beams of a laser, capped at 4 m
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The folder of the recordings
    #[arg(long, default_value = "../shared/data")]
    data: PathBuf,
    /// Only the recordings whose names contain this text
    #[arg(long, default_value = "")]
    only: String,
}

const HEAD: &str =
    "| recording | trajectory | relations, mean: m / degrees | ATE, first pose / rigid fit, m | cells per 1000 returns | sensors called faulty, mean | losses and doubts |
|---|---|---|---|---|---|---|";

pub(crate) fn run(options: &Options) {
    let measured = || -> Result<(), Failure> {
        let recordings = measure::load(&options.data)?;
        println!("{HEAD}");
        for recording in recordings.iter().filter(|recording| recording.name.contains(&options.only)) {
            row(recording.name, "odometry", &recording.odometry()?);
            for (beam, half_angle_deg) in [("points", 0.0), ("cones of ±7.5 degrees", 7.5)] {
                row(recording.name, beam, &recording.slamd(half_angle_deg, &Params::default())?);
            }
        }
        Ok(())
    };
    if let Err(error) = measured() {
        eprintln!("{}: {error}", options.data.display());
        std::process::exit(1);
    }
}

fn row(name: &str, what: &str, figures: &Figures) {
    let relations = figures
        .relations
        .as_ref()
        .map_or_else(|| "-".into(), |error| format!("{:.2} / {:.2}", error.translation_m[0], error.rotation_deg[0]));
    let ate = |metres: Option<f64>| metres.map_or_else(|| "-".into(), |metres| format!("{metres:.2}"));
    println!(
        "| {name} | {what} | {relations} | {} / {} | {:.1} | {:.2} | {} |",
        ate(figures.ate_first_m),
        ate(figures.ate_rigid_m),
        figures.cells,
        figures.faulty,
        figures.doubts
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The odometry's error is 6.5 m and 30 degrees.
    #[test]
    fn the_axis_keeps_the_heading_in_an_orthogonal_building() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
        let recordings = measure::load(&data).unwrap();
        let Some(freiburg) = recordings.iter().find(|recording| recording.name == "freiburg_079") else {
            println!("skipped: {} has no freiburg_079", data.display());
            return;
        };
        for half_angle_deg in [0.0, 7.5] {
            let error = freiburg.slamd(half_angle_deg, &Params::default()).unwrap().relations.unwrap();
            let ([metres, _], [degrees, _]) = (error.translation_m, error.rotation_deg);
            assert!(metres < 2.5 && degrees < 7.0, "{half_angle_deg}: {metres} m, {degrees} degrees");
        }
    }
}
