//! The page: a row per ring, and the drives that failed with why.

use super::Options;
use super::drive::{Case, Outcome, Reference};
use nalgebra::Vector2;
use slamd_core::{Point, Raster};
use slamd_metrics::quantile;
use std::fmt::Write as _;
use std::path::Path;

type Row = (Case, Outcome, Option<Reference>);

/// One drive on one line.
pub(super) fn line(case: Case, outcome: &Outcome, reference: Option<&Reference>) -> String {
    format!(
        "{} sensors, seed {}: seen {:.1} %, {} contacts (to {:.2} m/s), {:.0} m, {:.0} s (95 % after {}; by the truth {}), home {:.2} m, ATE {:.3} m (by the truth {:.3}): {} {:?}{}",
        case.sensors,
        case.seed,
        100.0 * outcome.seen,
        outcome.contacts.count,
        outcome.contacts.speed_m_s,
        outcome.way_m,
        outcome.time_s,
        seconds(outcome.most_seen_s),
        seconds(reference.and_then(|reference| reference.most_seen_s)),
        outcome.home_m,
        outcome.ate_m,
        reference.map_or(f64::NAN, |reference| reference.ate_m),
        outcome.report.as_ref().map_or_else(|| "not done".into(), ToString::to_string),
        outcome.status,
        refused(outcome),
    )
}

fn seconds(time_s: Option<f64>) -> String {
    time_s.map_or_else(|| "never".into(), |time_s| format!("{time_s:.0} s"))
}

fn refused(outcome: &Outcome) -> String {
    outcome.refused.iter().fold(String::new(), |mut text, (words, count)| {
        let _ = write!(text, "; {count} x {words}");
        text
    })
}

/// Why a drive is not as promised; nothing if it is.
fn complaints((_, outcome, reference): &Row) -> Vec<String> {
    let mut found = Vec::new();
    if outcome.seen < 0.95 {
        found.push(format!("{:.1} % of the floor seen", 100.0 * outcome.seen));
    }
    match &outcome.report {
        None => found.push(format!("not done after {:.0} s ({:?})", outcome.time_s, outcome.status)),
        Some(report) if !report.is_home => found.push("no way home".into()),
        Some(_) if outcome.home_m > 0.15 => found.push(format!("{:.2} m from the start at the end", outcome.home_m)),
        Some(_) => {}
    }
    if outcome.contacts.speed_m_s > 0.05 {
        found.push(format!("a contact at {:.2} m/s", outcome.contacts.speed_m_s));
    }
    if let Some(reference) = reference.as_ref().filter(|reference| outcome.ate_m > 2.0 * reference.ate_m + 0.05) {
        found.push(format!("ATE {:.2} m, driven by the truth {:.2} m", outcome.ate_m, reference.ate_m));
    }
    found
}

/// The whole page.
pub(super) fn page(options: &Options, rows: &[Row]) -> String {
    let mut page = String::from(
        "| sensors | homes | ended at home | floor seen, median / least | contacts per 100 m / fastest m/s | m from the start, median / p90 | robot time, median s | way, median m | 95 % seen after, median s / by the truth | ATE, median m / by the truth |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for &sensors in &options.rings {
        let rows: Vec<&Row> = rows.iter().filter(|(case, ..)| case.sensors == sensors).collect();
        let _ = writeln!(page, "{}", row(sensors, &rows));
    }
    page.push_str("\nNot as promised:\n\n");
    for row in rows {
        let found = complaints(row);
        if !found.is_empty() {
            let _ = writeln!(page, "- seed {}, {} sensors: {}", row.0.seed, row.0.sensors, found.join("; "));
        }
    }
    page
}

fn row(sensors: u8, rows: &[&Row]) -> String {
    let all = |value: &dyn Fn(&Row) -> f64| rows.iter().map(|row| value(row)).collect::<Vec<f64>>();
    let is_home = |(_, outcome, _): &Row| outcome.report.as_ref().is_some_and(|report| report.is_home);
    let home = rows.iter().filter(|row| is_home(row)).count();
    let seen = all(&|(_, outcome, _)| 100.0 * outcome.seen);
    let (contacts, way_m) = rows.iter().fold((0.0, 0.0), |(contacts, way_m), (_, outcome, _)| {
        (contacts + f64::from(outcome.contacts.count), way_m + outcome.way_m)
    });
    let speed_m_s = all(&|(_, outcome, _)| outcome.contacts.speed_m_s).into_iter().fold(0.0, f64::max);
    let off = all(&|(_, outcome, _)| outcome.home_m);
    let median = |values: &[f64]| quantile(values, 0.5);
    let times = |value: &dyn Fn(&Row) -> Option<f64>| {
        median(&rows.iter().map(|row| value(row).unwrap_or(f64::INFINITY)).collect::<Vec<f64>>())
    };
    format!(
        "| {sensors} | {} | {home} | {:.1} % / {:.1} % | {:.2} / {speed_m_s:.2} | {:.2} / {:.2} | {:.0} | {:.0} | {:.0} / {:.0} | {:.3} / {:.3} |",
        rows.len(),
        median(&seen),
        seen.iter().copied().fold(f64::INFINITY, f64::min),
        100.0 * contacts / f64::max(way_m, 1.0),
        median(&off),
        quantile(&off, 0.9),
        median(&all(&|(_, outcome, _)| outcome.time_s)),
        median(&all(&|(_, outcome, _)| outcome.way_m)),
        times(&|(_, outcome, _)| outcome.most_seen_s),
        times(&|(.., reference)| reference.as_ref().and_then(|reference| reference.most_seen_s)),
        median(&all(&|(_, outcome, _)| outcome.ate_m)),
        median(&all(&|(.., reference)| reference.as_ref().map_or(f64::NAN, |reference| reference.ate_m))),
    )
}

/// A map as a PGM file: occupied black, free white, unknown grey, the believed way dotted, its end a square.
pub(super) fn picture(map: &Raster, trail: &[Point], path: &Path) {
    let mut cells = map
        .occupancy
        .iter()
        .map(|&value| match value {
            Raster::UNKNOWN => 150,
            value => u8::try_from(255 - 2 * i32::from(value)).unwrap_or(0),
        })
        .collect::<Vec<u8>>();
    let mut mark = |point: Point, shade: u8| {
        if let Some(cell) = map.cell(point).and_then(|(column, row)| cells.get_mut(row * map.width + column)) {
            *cell = shade;
        }
    };
    trail.iter().for_each(|&point| mark(point, 190));
    if let Some(end) = trail.last() {
        (0..25)
            .for_each(|dot| mark(end + Vector2::new(f64::from(dot % 5 - 2), f64::from(dot / 5 - 2)) * map.cell_m, 100));
    }
    let mut bytes = format!("P5 {} {} 255\n", map.width, map.height).into_bytes();
    cells.chunks(map.width.max(1)).rev().for_each(|row| bytes.extend(row));
    std::fs::write(path, bytes).expect("the picture can be written");
}
