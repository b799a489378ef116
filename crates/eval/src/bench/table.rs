//! Runs as Markdown.

use super::case::Case;
use super::run::Run;
use slamd_core::FaultKind;
use slamd_metrics::{Detection, quantile};
use std::fmt::Write as _;

/// Head of the table of accuracy; one [`accuracy_row`] per case follows.
pub const ACCURACY_HEAD: &str = "\
| world | beam | faults | sensors | odometry | heading RMSE deg, median / p90 | ATE m, median / p90 / worst | lost at end / ever | path m, median | encoders alone: ATE m, median | map precision / coverage | NIS / NEES | us per sweep, mean / p99 |
|---|---|---|---|---|---|---|---|---|---|---|---|---|";

/// Head of the table of faults; [`fault_rows`] follow.
pub const FAULT_HEAD: &str = "\
| world | beam | faults | sensors | odometry | kind | precision | recall | latency s, median / p90 | at the earliest | found | false alarms per sensor and hour |
|---|---|---|---|---|---|---|---|---|---|---|---|";

/// One row of the table of accuracy.
#[must_use]
pub fn accuracy_row(case: &Case, runs: &[Run]) -> String {
    let all = |f: fn(&Run) -> f64| runs.iter().map(f).collect::<Vec<f64>>();
    let heading_deg = all(|run| run.accuracy.heading_rmse_deg);
    let ate_m = all(|run| run.accuracy.ate_m);
    let sweeps_us: Vec<f64> = runs.iter().flat_map(|run| run.sweeps_us.iter().copied()).collect();
    let median = |values: Vec<f64>| cell(Some(quantile(&values, 0.5)).filter(|value| value.is_finite()), 2);
    let count = |is: fn(&Run) -> bool| runs.iter().filter(|run| is(run)).count();
    format!(
        "| {} | {:.2} / {:.2} | {:.3} / {:.3} / {:.3} | {} / {} of {} | {:.0} | {:.2} | {} / {} | {} / {} | {:.0} / {:.0} |",
        conditions(case),
        quantile(&heading_deg, 0.5),
        quantile(&heading_deg, 0.9),
        quantile(&ate_m, 0.5),
        quantile(&ate_m, 0.9),
        quantile(&ate_m, 1.0),
        count(Run::is_lost_at_end),
        count(Run::is_ever_lost),
        runs.len(),
        quantile(&all(|run| run.path_m), 0.5),
        quantile(&all(|run| run.odometry_ate_m), 0.5),
        median(all(|run| run.map.precision.unwrap_or(f64::NAN))),
        median(all(|run| run.map.coverage.unwrap_or(f64::NAN))),
        median(all(|run| run.nis)),
        median(all(|run| run.nees)),
        mean(&sweeps_us),
        quantile(&sweeps_us, 0.99),
    )
}

/// The rows of one case in the table of faults: one over all kinds, then one for each kind that was there or was declared.
#[must_use]
pub fn fault_rows(case: &Case, runs: &[Run]) -> String {
    let sums = pooled(runs);
    let earliest_s: Vec<f64> = runs.iter().flat_map(|run| run.earliest_s.iter().copied()).collect();
    let row = |kind: &str, precision, recall, latencies_s: &[f64], faults: usize, alarms: String| {
        let earliest = if kind == FaultKind::Saturated.word() { seconds(&earliest_s) } else { String::new() };
        format!(
            "| {} | {kind} | {} | {} | {} | {earliest} | {} of {faults} | {alarms} |\n",
            conditions(case),
            cell(precision, 2),
            cell(recall, 2),
            seconds(latencies_s),
            latencies_s.len(),
        )
    };
    let latencies_s: Vec<f64> = sums.kinds.iter().flat_map(|kind| kind.latencies_s.iter().copied()).collect();
    let faults = sums.kinds.iter().map(|kind| kind.faults).sum();
    let alarms = cell(sums.false_alarms_per_hour(), 2);
    let mut text = row("all", sums.precision(), sums.recall(), &latencies_s, faults, alarms);
    for (kind, sums) in FaultKind::ALL.iter().zip(&sums.kinds) {
        if sums.faults > 0 || sums.declared_s > 0.0 {
            let latencies_s = &sums.latencies_s;
            text += &row(kind.word(), sums.precision(), sums.recall(), latencies_s, sums.faults, String::new());
        }
    }
    text
}

/// One line about one drive.
#[must_use]
pub fn run_line(case: &Case, run: &Run) -> String {
    let sums = &run.detection;
    let mut line = format!(
        "{case} seed={}: ATE {:.3} m, greatest {:.3}, last {:.3}; heading {:.2} deg; path {:.0} m, encoders {:.2} m; faults {} / {}, {} false alarms; map {} / {}; NIS {:.2}, NEES {:.2}",
        run.seed,
        run.accuracy.ate_m,
        run.accuracy.ate_max_m,
        run.last_m,
        run.accuracy.heading_rmse_deg,
        run.path_m,
        run.odometry_ate_m,
        cell(sums.precision(), 2),
        cell(sums.recall(), 2),
        sums.false_alarms,
        cell(run.map.precision, 2),
        cell(run.map.coverage, 2),
        run.nis,
        run.nees,
    );
    if run.is_ever_lost() {
        let _ = write!(line, "; LOST{}", if run.is_lost_at_end() { " AT THE END" } else { "" });
    }
    line
}

/// The sums over all runs.
#[must_use]
pub fn pooled(runs: &[Run]) -> Detection {
    let mut sums = Detection::default();
    runs.iter().for_each(|run| sums.add(&run.detection));
    sums
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn conditions(case: &Case) -> String {
    ["world", "beam", "faults", "sensors", "odometry"].map(|key| case.value(key)).join(" | ")
}

fn cell(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.digits$}"))
}

fn seconds(latencies_s: &[f64]) -> String {
    if latencies_s.is_empty() {
        return "-".into();
    }
    format!("{:.1} / {:.1}", quantile(latencies_s, 0.5), quantile(latencies_s, 0.9))
}
