//! The tables, and the drives that failed.

use super::drive::Case;
use super::judge::Verdict;
use super::kind::Kind;
use super::moved::{End, MENDED_WAY_M, Moved};
use slamd_metrics::quantile;
use std::fmt::Write as _;

type Judged = (Case, Verdict);

/// All tables as Markdown: every row is one kind and one ring.
pub(super) fn tables(judged: &[Judged]) -> String {
    let rows: Vec<&[Judged]> = judged.chunk_by(|a, b| (a.0.kind, a.0.sensors) == (b.0.kind, b.0.sensors)).collect();
    let mut page = String::from(
        "| robot | sensors | drives | silent | false alarms | named right | way until noticed m, median | NEES, median | uncertain s, mean | error at the end m, median / p90 | encoders alone m, p90 |\n|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in &rows {
        page += &general(row);
    }
    let moved: Vec<&[Judged]> = rows.iter().copied().filter(|row| row[0].0.kind.is_moved()).collect();
    if !moved.is_empty() {
        let _ = write!(
            page,
            "\n| moved | sensors | drives | right | unknown | wrong | noticed | way until noticed m, median | found | way until found m, median | mended within {MENDED_WAY_M} m |\n|---|---|---|---|---|---|---|---|---|---|---|\n"
        );
        for row in moved {
            page += &of_moved(row);
        }
    }
    let scaled = rows.iter().filter(|row| row[0].0.kind == Kind::Scale);
    for (index, row) in scaled.enumerate() {
        if index == 0 {
            page +=
                "\n| without robot.toml, sensors | drives | error of the scale, median | p90 |\n|---|---|---|---|\n";
        }
        let errors: Vec<f64> =
            row.iter().map(|(_, verdict)| (verdict.scale - 1.0).abs()).filter(|e| e.is_finite()).collect();
        let _ = writeln!(
            page,
            "| {} | {} | {:.3} | {:.3} |",
            row[0].0.sensors,
            errors.len(),
            quantile(&errors, 0.5),
            quantile(&errors, 0.9)
        );
    }
    page
}

fn general(row: &[Judged]) -> String {
    let case = &row[0].0;
    let count = |holds: fn(&Verdict) -> bool| row.iter().filter(|(_, verdict)| holds(verdict)).count();
    let all = |value: fn(&Verdict) -> f64| -> Vec<f64> {
        row.iter().map(|(_, verdict)| value(verdict)).filter(|value| value.is_finite()).collect()
    };
    let noticed_m: Vec<f64> = row.iter().filter_map(|(_, verdict)| verdict.noticed_m).collect();
    let named = if case.kind.causes().is_empty() {
        "-".into()
    } else {
        let told = count(|verdict| verdict.finding.is_some());
        format!("{} of {told} told", count(|verdict| verdict.finding.is_some_and(|(_, is_right)| is_right)))
    };
    let finals_m = all(|verdict| verdict.final_m);
    let uncertain_s = all(|verdict| verdict.uncertain_s);
    format!(
        "| {} | {} | {} | {} | {} | {named} | {} | {} | {:.1} | {} / {} | {} |\n",
        case.kind.word(),
        case.sensors,
        row.len(),
        count(|verdict| verdict.silent_s.is_some()),
        count(|verdict| verdict.is_false_alarm),
        number(&noticed_m, 0.5),
        number(&all(|verdict| verdict.nees), 0.5),
        uncertain_s.iter().fold(0.0, |sum, s| sum + s) / uncertain_s.len().max(1) as f64,
        number(&finals_m, 0.5),
        number(&finals_m, 0.9),
        number(&all(|verdict| verdict.odometry_final_m), 0.9),
    )
}

fn of_moved(row: &[Judged]) -> String {
    let moved: Vec<Moved> = row.iter().filter_map(|(_, verdict)| verdict.moved).collect();
    let ends = |end| moved.iter().filter(|moved| moved.end == end).count();
    let noticed_m: Vec<f64> = moved.iter().filter_map(|moved| moved.noticed_m).collect();
    let found_m: Vec<f64> = moved.iter().filter_map(|moved| moved.found_m).collect();
    let mended = match row[0].0.kind {
        Kind::Push => moved.iter().filter(|moved| moved.is_mended).count().to_string(),
        _ => "-".into(),
    };
    format!(
        "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {mended} |\n",
        row[0].0.kind.word(),
        row[0].0.sensors,
        moved.len(),
        ends(End::Right),
        ends(End::Unknown),
        ends(End::Wrong),
        noticed_m.len(),
        number(&noticed_m, 0.5),
        found_m.len(),
        number(&found_m, 0.5),
    )
}

/// A quantile; a dash if there is no value.
fn number(values: &[f64], share: f64) -> String {
    if values.is_empty() { "-".into() } else { format!("{:.2}", quantile(values, share)) }
}

/// One line for each drive that failed, or for all, with the command that simulates it again.
pub(super) fn drives(judged: &[Judged], is_verbose: bool) -> String {
    let mut page = String::new();
    for (case, verdict) in judged {
        let is_misnamed = verdict.finding.is_some_and(|(_, is_right)| !is_right);
        let mut failures = Vec::new();
        if let Some(silent_s) = verdict.silent_s {
            failures.push(format!("silent from {silent_s:.1} s"));
        }
        if verdict.is_false_alarm {
            failures.push("false alarm".into());
        }
        if is_misnamed && !case.kind.causes().is_empty() {
            failures.push("misnamed".into());
        }
        if failures.is_empty() && !is_verbose {
            continue;
        }
        let finding = verdict.finding.map_or("none", |(word, _)| word);
        let noticed = verdict.noticed_m.map_or_else(|| "never".into(), |m| format!("after {m:.1} m"));
        let _ = writeln!(
            page,
            "- {}: error {:.2} m at the end, {:.2} m at most, NEES {:.1}, uncertain {:.0} s, noticed {noticed}, finding {finding}: `{}`",
            if failures.is_empty() { "well".into() } else { failures.join(", ") },
            verdict.final_m,
            verdict.max_m,
            verdict.nees,
            verdict.uncertain_s,
            case.command(),
        );
    }
    if page.is_empty() { page } else { format!("\n{page}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(kind: Kind, silent_s: Option<f64>) -> Judged {
        let case = Case { kind, sensors: 16, seed: 7, seconds: 180.0 };
        (case, Verdict { silent_s, finding: Some(("turn_scale", true)), ..Verdict::default() })
    }

    #[test]
    fn rows_are_kinds_and_rings() {
        let page = tables(&[judged(Kind::Base, None), judged(Kind::Base, Some(20.0)), judged(Kind::Push, None)]);
        assert!(page.contains("| base | 16 | 2 | 1 | 0 | 2 of 2 told | - |"), "{page}");
        assert!(page.contains("| push | 16 | 1 | 0 |"), "{page}");
    }

    #[test]
    fn a_failed_drive_has_its_command() {
        let lines = drives(&[judged(Kind::WheelsSwapped, Some(20.0)), judged(Kind::Nominal, None)], false);
        assert_eq!(lines.trim().lines().count(), 1);
        assert!(lines.contains("silent from 20.0 s"), "{lines}");
        assert!(lines.contains("--seed 7 --sensors 16 --duration 180 --robot-fault wheels-swapped"), "{lines}");
    }
}
