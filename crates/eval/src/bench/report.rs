//! The accuracy tables as a document that says how its figures came about.

use super::case::Case;
use super::run::Run;
use super::table::{ACCURACY_HEAD, FAULT_HEAD, accuracy_row, fault_rows};
use super::{machine, targets};
use std::fmt::Write as _;

/// What follows this line in the document was written by a person, and stays.
pub const BY_HAND: &str = "<!-- by hand -->";

/// Both tables: accuracy, then faults.
#[must_use]
pub fn tables(cases: &[Case], runs: &[Vec<Run>]) -> String {
    let mut text = format!("{ACCURACY_HEAD}\n");
    for (case, runs) in cases.iter().zip(runs) {
        let _ = writeln!(text, "{}", accuracy_row(case, runs));
    }
    let _ = writeln!(text, "\n{FAULT_HEAD}");
    for (case, runs) in cases.iter().zip(runs) {
        text += &fault_rows(case, runs);
    }
    text
}

/// The document: command, meanings, tables, targets, and what `before` says after [`BY_HAND`].
#[must_use]
pub fn document(command: &str, cases: &[Case], runs: &[Vec<Run>], before: &str) -> String {
    let (cpu, tables, targets) = (machine::cpu(), tables(cases, runs), targets::targets(cases, runs));
    let by_hand = by_hand(before);
    let seconds = cases.first().map_or(0.0, |case| case.seconds);
    format!(
        "\
# Accuracy

Written by `{command}`, but for what follows the line \"{BY_HAND}\". Simulated drives of {seconds:.0} s, each figure over all seeds; time
measured on {cpu}.

{MEANINGS}
{tables}
## Targets

{targets}
{BY_HAND}
{by_hand}"
    )
}

/// What follows the line [`BY_HAND`]; the introduction, which quotes it, is none.
#[must_use]
pub fn by_hand(before: &str) -> &str {
    before.split_once(&format!("\n{BY_HAND}\n")).map_or("", |(_, rest)| rest)
}

const MEANINGS: &str = "\
- **odometry**: scale of the wheels' errors; 1 is wheels that differ by 1 %, a base wrong by 2 % and slip of 5 mm after a metre.
- **faults**: `paper` has of n sensors n/16 saturated, n/16 missing and n/8 noisy from the start; `late` has n/16 of each kind from 60 s on.
- **heading RMSE, ATE**: root mean squares over a drive, aligned with the truth at the first pose only; the truth is interpolated to
  the estimate's time. `encoders alone` is the ATE of the wheels without any sonar.
- **lost at end**: the last position is more than 0.5 m off. **ever**: some position is; a drive whose ATE exceeds 0.5 m is among these.
- **map precision**: share of occupied cells within 5 cm of a true wall. **coverage**: share of the visible walls that have an occupied cell
  within 5 cm; visible is what was in line of sight of the true path, within 3 m and up to 45 degrees off its normal. The map is scored in
  the frame that it is drawn in: origin at the start, axes along the walls (the paper's: aligned at the first pose).
- **NIS, NEES**: per degree of freedom, 1 for a consistent filter, more for one that believes itself too good. NEES is taken in the
  map frame as it is defined: origin at the start, axes along the walls.
- **us per sweep**: time that the thread computed, from a sweep's bytes to its estimate and map, all of it. What the first sweeps cost,
  which wait for the building's axis, counts with the sweeps that they are used with.
- **precision, recall** of faults: in sensor-seconds. Precision of a kind: of the time for which sensors were declared to be of this kind,
  the share in which they failed in whatever way. Recall of a kind: of the time for which sensors were of this kind, the share in which they were
  declared. **latency**: from the fault's begin, or the first sweep, until the verdict is out; with faults from the start that contains the
  seconds in which the building's axis is sought. **at the earliest**: until a healthy sensor in the place of a saturated one would first have
  heard something; before that no method can tell them apart. **false alarms**: verdicts on sensors that do not fail.
- Median, p90 and the like are values that occurred: of 20, the median is the 11th.
";
