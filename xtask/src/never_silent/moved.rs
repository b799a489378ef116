//! What became of a robot that was carried or pushed.

use super::judge::{Sweep, driven_m};
use super::kind::{Kind, LATE_S};
use slamd_core::{Estimate, LocalizationEvent};
use slamd_metrics::Pair;

/// A robot that was carried is found if its position is nearer to the truth than this, metres.
const FOUND_M: f64 = 0.3;
/// A push is mended if the error is below this again, metres, within this way.
const MENDED_M: f64 = 0.15;
pub(super) const MENDED_WAY_M: f64 = 2.0;
/// Way from one sweep to the next that no wheel makes: along any direction, and sideways, metres.
const CARRIED_M: f64 = 0.3;
const SIDEWAYS_M: f64 = 0.01;
/// Length of a push, seconds.
const PUSH_S: f64 = 0.6;

/// Where slamd says that a robot is which was carried away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// At the right place.
    Right,
    /// It says that it does not know.
    Unknown,
    /// At a wrong place.
    Wrong,
}

/// What became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moved {
    pub(super) end: End,
    /// Way until slamd said that the pose is uncertain, metres.
    pub(super) noticed_m: Option<f64>,
    /// Way until the pose was right, and stated as such, metres.
    pub(super) found_m: Option<f64>,
    /// The error was small again in time.
    pub(super) is_mended: bool,
}

/// Judges the drive after the hands; `None` if they never came.
pub(super) fn moved(
    kind: Kind,
    pairs: &[Pair<Estimate>],
    sweeps: &[Sweep],
    localization: &[LocalizationEvent],
) -> Option<Moved> {
    let jump = pairs.windows(2).position(|pair| {
        let way = (pair[0].truth.inverse() * pair[1].truth).position().coords;
        let is_jump = if kind == Kind::Push { way.y.abs() > SIDEWAYS_M } else { way.norm() > CARRIED_M };
        is_jump && pair[1].at.seconds() >= LATE_S
    })?;
    let at_s = pairs[jump + 1].at.seconds() + if kind == Kind::Push { PUSH_S } else { 0.0 };
    let noticed_s = localization.iter().filter(|event| event.is_lost()).map(|event| event.at.seconds());
    let noticed_s = noticed_s.filter(|noticed_s| *noticed_s >= LATE_S).reduce(f64::min);
    Some(after(sweeps, at_s, noticed_s))
}

fn after(sweeps: &[Sweep], at_s: f64, noticed_s: Option<f64>) -> Moved {
    let from_m = driven_m(sweeps, at_s);
    let rest = || sweeps.iter().filter(|sweep| sweep.at_s >= at_s);
    let is_found = |sweep: &&Sweep| !sweep.is_uncertain && sweep.error_m < FOUND_M;
    let is_mended = |sweep: &Sweep| sweep.driven_m - from_m <= MENDED_WAY_M && sweep.error_m < MENDED_M;
    let end = match sweeps.last() {
        Some(last) if last.is_uncertain => End::Unknown,
        Some(last) if last.error_m < FOUND_M => End::Right,
        _ => End::Wrong,
    };
    Moved {
        end,
        noticed_m: noticed_s.map(|noticed_s| (driven_m(sweeps, noticed_s) - from_m).max(0.0)),
        found_m: rest().find(is_found).map(|sweep| sweep.driven_m - from_m),
        is_mended: rest().any(is_mended),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(parts: &[(f64, f64, bool)]) -> Vec<Sweep> {
        let mut sweeps: Vec<Sweep> = Vec::new();
        for &(until_s, error_m, is_uncertain) in parts {
            while 0.1 * (sweeps.len() as f64) < until_s {
                let at_s = 0.1 * sweeps.len() as f64;
                sweeps.push(Sweep {
                    at_s,
                    driven_m: 0.3 * at_s,
                    error_m,
                    turned_rad: 0.0,
                    sigma_m: 0.02,
                    nees: 1.0,
                    is_uncertain,
                });
            }
        }
        sweeps
    }

    #[test]
    fn a_robot_that_is_found_counts_its_way() {
        let sweeps = drive(&[(60.0, 0.05, false), (70.0, 3.0, true), (100.0, 0.1, false)]);
        let moved = after(&sweeps, 60.0, Some(62.0));
        assert_eq!(moved.end, End::Right);
        assert!((moved.noticed_m.unwrap() - 0.6).abs() < 0.04 && (moved.found_m.unwrap() - 3.0).abs() < 0.04);
        assert!(!moved.is_mended);
    }

    #[test]
    fn unknown_and_wrong_are_told_apart() {
        let end = |is_uncertain| after(&drive(&[(60.0, 0.05, false), (99.0, 3.0, is_uncertain)]), 60.0, None).end;
        assert_eq!([end(true), end(false)], [End::Unknown, End::Wrong]);
    }

    #[test]
    fn a_push_is_mended_within_its_way() {
        let mended =
            |until_s| after(&drive(&[(60.0, 0.05, false), (until_s, 0.4, false), (99.0, 0.1, false)]), 60.0, None);
        assert!(mended(65.0).is_mended && !mended(68.0).is_mended);
    }
}
