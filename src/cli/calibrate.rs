//! `slamd calibrate CAPTURE`

use super::outputs::ForceArg;
use super::state_args::write_robot;
use super::{Failure, Kind, terminal};
use crate::calibrate::drive::{Drive, Mapper};
use crate::calibrate::{CalibrateError, Estimated, PASSES, Report, Unobservable, calibrate};
use clap::Args;
use slamd_capture::CaptureReader;
use slamd_core::{Config, Method};
use std::path::PathBuf;

/// Calibrate a robot's wheels and sensors from a drive.
#[derive(Debug, Args)]
pub(super) struct CalibrateArgs {
    /// A capture (MCAP) of some minutes of driving between walls.
    capture: PathBuf,
    /// Write the robot's configuration with the results to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Start from this configuration instead of the capture's.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
}

impl CalibrateArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let name = self.capture.display();
        let mut guard = self.force.guard().reads(&self.capture).reads_all(self.config.as_deref());
        self.out.iter().try_for_each(|path| guard.check(path))?;
        let info = CaptureReader::open(&self.capture)?.info().clone();
        let config = super::config::of_recording(self.config.as_deref(), &info, &self.capture)?;
        let config = Config { method: Method::Walls, ..config };
        let bar = terminal::progress(None);
        let report = calibrate(&config, |config, pass| -> Result<Drive, Failure> {
            let mut mapper = Mapper::new(config);
            for record in CaptureReader::open(&self.capture)? {
                let record = record?;
                terminal::show(&bar, record.at().seconds());
                bar.set_prefix(format!("pass {} of {}", pass + 1, PASSES + 1));
                mapper.take(&record);
            }
            Ok(mapper.finish())
        });
        bar.finish_and_clear();
        let report = report.map_err(|failure| Failure::new(failure.kind, format!("{name}: {failure}")))?;
        print(&report);
        if let Some(path) = &self.out {
            write_robot(guard.output(path)?, &report.config, "slamd calibrate")?;
            terminal::say(format_args!("robot: {}", path.display()));
        }
        Ok(())
    }
}

impl From<CalibrateError> for Failure {
    fn from(error: CalibrateError) -> Self {
        Self::new(Kind::Data, error.to_string())
    }
}

/// Prints the report as a table.
fn print(report: &Report) {
    for (sentence, is_mended) in &report.findings {
        let effect = if *is_mended { "mended" } else { "not sure: not written" };
        let sentence = sentence.split("; corrected for this run").next().unwrap_or(sentence);
        terminal::say(format_args!("{sentence} ({effect})"));
    }
    if !report.unobservable.contains(&Unobservable::Wheels) {
        let wheels = &report.wheels;
        terminal::say(format_args!("wheel ratio {:.4} ± {:.4}", wheels.wheel_ratio, wheels.wheel_ratio_sigma));
        terminal::say(format_args!("wheel base {:.4} ± {:.4} m", wheels.wheel_base_m, wheels.wheel_base_sigma_m));
    }
    for unobservable in &report.unobservable {
        terminal::say(unobservable);
    }
    terminal::say("sensor  range bias cm   bearing offset deg   innovation RMS cm: before  after");
    let mut unknown = [0; 2];
    for (sensor, result) in report.sensors.iter().enumerate() {
        let bearing = result
            .bearing_offset_rad
            .map(|found| Estimated { value: found.value.to_degrees(), sigma: found.sigma.to_degrees() });
        let bias =
            result.range_bias_m.map(|found| Estimated { value: 100.0 * found.value, sigma: 100.0 * found.sigma });
        unknown[0] += u32::from(bias.is_none());
        unknown[1] += u32::from(bearing.is_none());
        let rms = |rms_m: f64| if rms_m.is_finite() { format!("{:.2}", 100.0 * rms_m) } else { "-".into() };
        terminal::say(format_args!(
            "{sensor:>6}  {:>13}   {:>18}   {:>25}  {:>5}",
            with_sigma(bias),
            with_sigma(bearing),
            rms(result.before_m),
            rms(result.after_m)
        ));
    }
    terminal::say(
        "Not observable in a drive and left out: a bias that all sensors share, a shift or a rotation of the whole ring.",
    );
    for (count, what) in unknown.into_iter().zip(["range bias", "bearing offset"]).filter(|(count, _)| *count > 0) {
        terminal::say(format_args!("The {what} of {count} sensors is not observable in this drive (?)."));
    }
    if let Some([before, after]) = &report.accuracy {
        terminal::say(format_args!("ATE before {:.3} m, after {:.3} m", before.ate_m, after.ate_m));
        terminal::say(format_args!(
            "heading before {:.2}, after {:.2} degrees RMS",
            before.heading_rmse_deg, after.heading_rmse_deg
        ));
    }
    terminal::say(report.verdict());
}

fn with_sigma(found: Option<Estimated>) -> String {
    found.map_or_else(|| "?".into(), |found| format!("{:+.2} ± {:.2}", found.value, found.sigma))
}
