//! The project's targets beside what was measured; a target without a row to measure it in is left out.

use super::case::Case;
use super::run::Run;
use super::table::pooled;
use slamd_metrics::quantile;
use slamd_sim::fault::FaultMix;
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;
use std::fmt::Write as _;

type Row<'a> = (&'a Case, &'a [Run]);

/// One target.
struct Target {
    what: String,
    /// In words, with its unit.
    wanted: &'static str,
    measured: f64,
    is_met: bool,
}

/// The table of targets that the rows speak of; empty where there is none.
#[must_use]
pub fn targets(cases: &[Case], runs: &[Vec<Run>]) -> String {
    let rows: Vec<Row<'_>> = cases.iter().zip(runs.iter().map(Vec::as_slice)).collect();
    let mut found = Vec::new();
    for &row in &rows {
        found.extend(of_row(row));
    }
    let usual: Vec<&Row<'_>> = rows.iter().filter(|(case, _)| is_usual(case)).collect();
    let drives: usize = usual.iter().map(|(_, runs)| runs.len()).sum();
    if drives > 0 {
        let lost = usual.iter().flat_map(|(_, runs)| *runs).filter(|run| run.is_lost_at_end()).count() as f64;
        let what = format!("usual conditions, all worlds: drives lost at the end, of {drives}");
        found.push(at_most(what, "0", lost, 0.0));
    }
    let mut text = String::new();
    for target in &found {
        let verdict = if target.is_met { "met" } else { "**not met**" };
        let _ = writeln!(text, "| {} | {} | {:.3} | {verdict} |", target.what, target.wanted, target.measured);
    }
    if text.is_empty() { text } else { format!("| figure | wanted | measured | |\n|---|---|---|---|\n{text}") }
}

fn of_row((case, runs): Row<'_>) -> Vec<Target> {
    let all = |f: fn(&Run) -> f64| runs.iter().map(f).collect::<Vec<f64>>();
    let ate = |share| quantile(&all(|run| run.accuracy.ate_m), share);
    let heading = |share| quantile(&all(|run| run.accuracy.heading_rmse_deg), share);
    let name = |figure: &str| format!("{case}: {figure}");
    let mut found = Vec::new();
    if case.beam == BeamShape::Point && case.mix == FaultMix::Paper && case.world == "home" {
        found.push(at_most(name("ATE, median"), "<= 0.04 m", ate(0.5), 0.04));
        found.push(at_most(name("ATE, worst"), "<= 0.15 m", ate(1.0), 0.15));
        found.push(at_most(name("heading RMSE, median"), "<= 1.0 deg", heading(0.5), 1.0));
    }
    if case.odometry_errors > 2.0 {
        found.push(at_most(name("ATE, p90"), "<= 0.30 m", ate(0.9), 0.30));
    }
    if case.sensors == 8 && case.world == "furnished" && case.mix == FaultMix::None {
        found.push(at_most(name("ATE, p90"), "<= 0.20 m", ate(0.9), 0.20));
    }
    if case.mix == FaultMix::None {
        let alarms = pooled(runs).false_alarms_per_hour().unwrap_or(f64::NAN);
        found.push(at_most(name("false alarms per sensor and hour"), "<= 1", alarms, 1.0));
    }
    if is_usual(case) {
        let sweeps_us: Vec<f64> = runs.iter().flat_map(|run| run.sweeps_us.iter().copied()).collect();
        let mean_us = sweeps_us.iter().sum::<f64>() / sweeps_us.len() as f64;
        let precision = quantile(&all(|run| run.map.precision.unwrap_or(f64::NAN)), 0.1);
        let coverage = quantile(&all(|run| run.map.coverage.unwrap_or(f64::NAN)), 0.1);
        found.push(at_most(name("heading RMSE, p90"), "<= 1.0 deg", heading(0.9), 1.0));
        found.push(at_most(name("ATE, p90"), "<= 0.08 m", ate(0.9), 0.08));
        found.push(at_least(name("map precision, p10"), ">= 0.90", precision, 0.90));
        found.push(at_least(name("map coverage, p10"), ">= 0.85", coverage, 0.85));
        found.push(at_most(name("time per sweep, mean"), "<= 15 us", mean_us, 15.0));
        found.push(at_most(name("time per sweep, p99"), "<= 60 us", quantile(&sweeps_us, 0.99), 60.0));
    }
    if case.mix != FaultMix::None && case.sensors == 32 && case.odometry_errors < 2.0 {
        let sums = pooled(runs);
        found.push(at_least(name("fault precision"), ">= 0.95", sums.precision().unwrap_or(f64::NAN), 0.95));
        found.push(at_least(name("fault recall"), ">= 0.95", sums.recall().unwrap_or(f64::NAN), 0.95));
        if case.mix == FaultMix::Late {
            let [saturated, missing, noisy, _] = sums.kinds.each_ref().map(|kind| quantile(&kind.latencies_s, 0.9));
            found.push(at_most(name("latency saturated, p90"), "<= 5 s", saturated, 5.0));
            found.push(at_most(name("latency missing, p90"), "<= 0.5 s", missing, 0.5));
            found.push(at_most(name("latency noisy, p90"), "<= 2 s", noisy, 2.0));
        }
    }
    found
}

/// The conditions of the general targets: cone beams, the paper's faults, 32 sensors, usual wheels, a fixed world.
fn is_usual(case: &Case) -> bool {
    case.world != World::RANDOM
        && *case == Case { world: case.world.clone(), seconds: case.seconds, method: case.method, ..Case::usual() }
}

fn at_most(what: String, wanted: &'static str, measured: f64, most: f64) -> Target {
    Target { what, wanted, measured, is_met: measured <= most }
}

fn at_least(what: String, wanted: &'static str, measured: f64, least: f64) -> Target {
    Target { what, wanted, measured, is_met: measured >= least }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_measured_is_not_met() {
        assert!(!at_most(String::new(), "", f64::NAN, 1.0).is_met);
        assert!(!at_least(String::new(), "", f64::NAN, 1.0).is_met);
    }

    #[test]
    fn no_rows_no_targets() {
        assert_eq!(targets(&[], &[]), "");
    }
}
