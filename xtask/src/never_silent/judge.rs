//! Compares what slamd said with the truth.
//!
//! A pose is *silently wrong* if it is farther off than [`MIN_ERROR_M`] and than [`SIGMAS`] of its stated standard deviations, in the map
//! frame, and no localization event calls it uncertain. A drive is, if its poses are so for [`SILENT_S`] without a break.

use super::drive::{Case, Trace};
use super::kind::Kind;
use super::moved::{Moved, moved};
use nalgebra::Vector3;
use slamd_core::{Estimate, LocalizationEvent, ModelState, Pose2, Timestamp, wrap_angle};
use slamd_metrics::{Pair, building_frame, quantile};
use std::fmt::Write as _;

/// Errors below this are not wrong, metres.
const MIN_ERROR_M: f64 = 0.3;
/// Errors below this many stated standard deviations are not wrong.
const SIGMAS: f64 = 3.0;
/// Minimum length of a silent error, seconds.
pub(super) const SILENT_S: f64 = 5.0;
/// Poses that are called uncertain though the error stays below this are a false alarm, metres.
const WELL_M: f64 = 0.15;
/// Part of the drive whose scale is measured: metres of true way.
const SCALE_FROM_M: f64 = 5.0;
const SCALE_UNTIL_M: f64 = 15.0;
/// The scale is measured in each part of this length, metres.
const SCALE_PART_M: f64 = 2.5;
/// How often the timeline of a drive says how it fares, seconds.
const EVERY_S: f64 = 10.0;
/// Two poses farther apart than this are not driven, metres: the robot was carried.
const CARRIED_M: f64 = 0.3;

/// One sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sweep {
    pub(super) at_s: f64,
    /// True way so far, metres.
    pub(super) driven_m: f64,
    /// Error of the position in the map frame, metres.
    pub(super) error_m: f64,
    /// Error of the heading, radians.
    pub(super) turned_rad: f64,
    /// Greatest stated standard deviation of the position, metres.
    pub(super) sigma_m: f64,
    /// Normalized estimation error squared per degree of freedom.
    pub(super) nees: f64,
    /// The pose was called uncertain.
    pub(super) is_uncertain: bool,
}

impl Sweep {
    const fn is_silently_wrong(&self) -> bool {
        !self.is_uncertain && self.error_m > MIN_ERROR_M && self.error_m > SIGMAS * self.sigma_m
    }
}

/// What came of a drive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Verdict {
    /// Start of the first silent error, seconds from the session's start.
    pub(crate) silent_s: Option<f64>,
    pub(super) final_m: f64,
    pub(super) max_m: f64,
    pub(super) nees: f64,
    pub(super) uncertain_s: f64,
    pub(super) odometry_final_m: f64,
    /// True way until slamd first said that something is wrong, metres.
    pub(super) noticed_m: Option<f64>,
    /// The first finding about the robot, and whether it names the cause.
    pub(super) finding: Option<(&'static str, bool)>,
    /// Something was said though all was well.
    pub(super) is_false_alarm: bool,
    /// Estimated over true size of the driven path.
    pub(super) scale: f64,
    pub(super) moved: Option<Moved>,
}

/// Judges a drive.
pub(super) fn judge(case: &Case, trace: &Trace) -> Verdict {
    let Some(first) = trace.pairs.first() else {
        // Without a single pose nothing is wrong, and nothing is right.
        return Verdict { nees: f64::NAN, scale: f64::NAN, ..Verdict::default() };
    };
    let sweeps = sweeps(trace);
    let odometry_frame = first.truth * first.estimate.odometry.inverse();
    let last = trace.pairs.last().unwrap_or(first);
    let odometry = (odometry_frame * last.estimate.odometry).position();
    let mut finding = trace.model.iter().filter(|event| event.state != ModelState::Resolved);
    let first_finding = finding.next();
    let noticed = first_finding.map(|event| event.at);
    let lost = trace.localization.iter().find(|event| event.is_lost()).map(|event| event.at);
    let noticed = [noticed, lost].into_iter().flatten().min();
    Verdict {
        silent_s: first_silent_s(&sweeps),
        final_m: sweeps.last().map_or(f64::NAN, |sweep| sweep.error_m),
        max_m: sweeps.iter().map(|sweep| sweep.error_m).fold(0.0, f64::max),
        nees: quantile(&sweeps.iter().map(|sweep| sweep.nees).filter(|nees| nees.is_finite()).collect::<Vec<_>>(), 0.5),
        uncertain_s: uncertain_s(&sweeps),
        odometry_final_m: (odometry - last.truth.position()).norm(),
        noticed_m: noticed.map(|at| driven_m(&sweeps, at.seconds())),
        finding: first_finding
            .map(|event| (event.finding.aspect.word(), case.kind.causes().contains(&event.finding.aspect))),
        is_false_alarm: case.kind == Kind::Nominal && (first_finding.is_some() || has_false_alarm(&sweeps)),
        scale: scale(&trace.pairs, &sweeps),
        moved: if case.kind.is_moved() { moved(case.kind, &trace.pairs, &sweeps, &trace.localization) } else { None },
    }
}

/// What was said in a drive, with the error at that time; and how it fares every ten seconds.
pub(crate) fn events(trace: &Trace) -> String {
    let model = trace.model.iter().map(|event| (event.at.seconds(), event.sentence()));
    let said = trace.localization.iter().map(|event| {
        let since_s = event.since.seconds();
        (event.at.seconds(), format!("{:?} since {since_s:.1} s", event.change))
    });
    let mut said: Vec<(f64, String)> = model.chain(said).collect();
    said.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut lines, mut said, mut next_s) = (String::new(), said.into_iter().peekable(), 0.0);
    for sweep in sweeps(trace) {
        let Sweep { at_s, driven_m, error_m, turned_rad, sigma_m, nees, .. } = sweep;
        let turned_deg = turned_rad.to_degrees();
        let mut line = |text: &str| {
            let _ = writeln!(
                lines,
                "{at_s:7.1} s {driven_m:5.1} m: {error_m:.2} m and {turned_deg:.1} degrees off, sigma {sigma_m:.2} m, NEES {nees:.1} {text}"
            );
        };
        while let Some((_, text)) = said.next_if(|(said_s, _)| *said_s <= at_s) {
            line(&text);
        }
        if at_s >= next_s {
            next_s = at_s + EVERY_S;
            line(if sweep.is_uncertain { "(uncertain)" } else { "" });
        }
    }
    lines
}

/// The sweeps of a drive in the map frame. A corrected robot begins its map anew from the same start, along another wall perhaps: then
/// the first pose of that map selects one of the four rotations again.
fn sweeps(trace: &Trace) -> Vec<Sweep> {
    let Trace { start, truths, pairs, localization, revised, .. } = trace;
    let (Some(start), Some(first)) = (start, pairs.first()) else { return Vec::new() };
    // A correction may come before the first pose: that is not the start.
    let frame = |pair: &Pair<Estimate>| Pose2 { theta_rad: building_frame(pair).theta_rad, ..*start }.inverse();
    let mut map_from_world = frame(first);
    let truth_at = |at: Timestamp| truths.iter().find(|truth| truth.0 >= at).map_or(first.truth, |truth| truth.1);
    let mut revised = revised.iter().peekable();
    let (mut driven_m, mut before) = (0.0, first.truth);
    let sweep = |pair: &Pair<Estimate>| {
        let step_m = (pair.truth.position() - before.position()).norm();
        driven_m += if step_m < CARRIED_M { step_m } else { 0.0 };
        before = pair.truth;
        while let Some(&(_, first)) = revised.next_if(|(at, _)| *at <= pair.at) {
            map_from_world = frame(&Pair { at: first.at, estimate: first, truth: truth_at(first.at) });
        }
        let (pose, truth, cov) = (pair.estimate.pose, map_from_world * pair.truth, pair.estimate.covariance);
        let error = error(pose, truth);
        let (mean, half) = (0.5 * (cov[(0, 0)] + cov[(1, 1)]), 0.5 * (cov[(0, 0)] - cov[(1, 1)]));
        let nees = cov.try_inverse().map_or(f64::NAN, |information| (error.transpose() * information * error)[0] / 3.0);
        Sweep {
            at_s: pair.at.seconds(),
            driven_m,
            error_m: error.xy().norm(),
            turned_rad: error.z,
            sigma_m: (mean + libm::hypot(half, cov[(0, 1)])).sqrt(),
            nees,
            is_uncertain: is_uncertain(localization, pair.at),
        }
    };
    pairs.iter().map(sweep).collect()
}

fn error(pose: Pose2, truth: Pose2) -> Vector3<f64> {
    Vector3::new(pose.x_m - truth.x_m, pose.y_m - truth.y_m, wrap_angle(pose.theta_rad - truth.theta_rad))
}

/// Whether an interval of the localization events holds that time. A later event may extend an interval into the past.
fn is_uncertain(localization: &[LocalizationEvent], at: Timestamp) -> bool {
    localization.iter().enumerate().any(|(index, event)| {
        let until = if event.is_lost() { localization.get(index + 1).map(|next| next.at) } else { Some(event.at) };
        at >= event.since && until.is_none_or(|until| at <= until)
    })
}

/// Start of the first error that nobody spoke of for [`SILENT_S`], seconds.
fn first_silent_s(sweeps: &[Sweep]) -> Option<f64> {
    let runs = sweeps.chunk_by(|a, b| a.is_silently_wrong() == b.is_silently_wrong());
    let lasts = |run: &&[Sweep]| run[0].is_silently_wrong() && run[run.len() - 1].at_s - run[0].at_s >= SILENT_S;
    runs.into_iter().find(lasts).map(|run| run[0].at_s)
}

/// Seconds of poses that are called uncertain.
fn uncertain_s(sweeps: &[Sweep]) -> f64 {
    let steps = sweeps.windows(2).filter(|pair| pair[1].is_uncertain);
    steps.map(|pair| pair[1].at_s - pair[0].at_s).fold(0.0, |sum, step_s| sum + step_s)
}

/// Whether poses were called uncertain for [`SILENT_S`] and none of them was off.
fn has_false_alarm(sweeps: &[Sweep]) -> bool {
    sweeps.chunk_by(|a, b| a.is_uncertain == b.is_uncertain).any(|run| {
        let length_s = run[run.len() - 1].at_s - run[0].at_s;
        run[0].is_uncertain && length_s >= SILENT_S && run.iter().all(|sweep| sweep.error_m <= WELL_M)
    })
}

/// True way until that time, metres.
pub(super) fn driven_m(sweeps: &[Sweep], at_s: f64) -> f64 {
    sweeps.iter().take_while(|sweep| sweep.at_s <= at_s).last().map_or(0.0, |sweep| sweep.driven_m)
}

/// Size of the estimated path over that of the true one, from 5 to 15 m of way: the spread of the points of each part of the way. The
/// median of the parts, for a jump of the pose in one of them is no scale.
fn scale(pairs: &[Pair<Estimate>], sweeps: &[Sweep]) -> f64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some metres of way")]
    let part = |sweep: &Sweep| (sweep.driven_m / SCALE_PART_M) as usize;
    let way: Vec<_> = pairs
        .iter()
        .zip(sweeps)
        .filter(|(_, sweep)| (SCALE_FROM_M..SCALE_UNTIL_M).contains(&sweep.driven_m))
        .map(|(pair, sweep)| (pair, part(sweep)))
        .collect();
    let ratios: Vec<f64> = way
        .chunk_by(|a, b| a.1 == b.1)
        .map(|part| spread(part, |pair| pair.estimate.pose) / spread(part, |pair| pair.truth))
        .filter(|ratio| ratio.is_finite())
        .collect();
    if ratios.is_empty() { f64::NAN } else { quantile(&ratios, 0.5) }
}

fn spread(part: &[(&Pair<Estimate>, usize)], pose: impl Fn(&Pair<Estimate>) -> Pose2) -> f64 {
    let points = part.iter().map(|(pair, _)| pose(pair).position().coords);
    let middle = points.clone().sum::<nalgebra::Vector2<f64>>() / part.len() as f64;
    points.map(|point| (point - middle).norm_squared()).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::LocalizationChange;
    use std::time::Duration;

    /// A drive of ten sweeps per second; each part lasts so many seconds and has this error, sigma and flag.
    fn drive(parts: &[(f64, f64, f64, bool)]) -> Vec<Sweep> {
        let mut sweeps: Vec<Sweep> = Vec::new();
        for &(seconds, error_m, sigma_m, is_uncertain) in parts {
            let mut left_s = seconds;
            while left_s > 1e-9 {
                let at_s = 0.1 * sweeps.len() as f64;
                sweeps.push(Sweep {
                    at_s,
                    driven_m: 0.3 * at_s,
                    error_m,
                    turned_rad: 0.0,
                    sigma_m,
                    nees: 1.0,
                    is_uncertain,
                });
                left_s -= 0.1;
            }
        }
        sweeps
    }

    fn silent_s(parts: &[(f64, f64, f64, bool)]) -> Option<f64> {
        first_silent_s(&drive(parts)).map(|at_s| (10.0 * at_s).round() / 10.0)
    }

    #[test]
    fn an_error_that_nobody_speaks_of_is_silent() {
        assert_eq!(silent_s(&[(10.0, 0.1, 0.02, false), (6.0, 0.5, 0.02, false)]), Some(10.0));
        // At the end of a drive, too, and whatever follows.
        assert_eq!(silent_s(&[(6.0, 0.5, 0.02, false), (9.0, 0.1, 0.02, false)]), Some(0.0));
    }

    #[test]
    fn small_covered_short_and_flagged_errors_are_not() {
        assert_eq!(silent_s(&[(60.0, 0.29, 0.02, false)]), None);
        assert_eq!(silent_s(&[(60.0, 1.4, 0.5, false)]), None);
        assert_eq!(silent_s(&[(4.9, 2.0, 0.02, false), (1.0, 0.1, 0.02, false), (4.9, 2.0, 0.02, false)]), None);
        assert_eq!(silent_s(&[(60.0, 2.0, 0.02, true)]), None);
        assert_eq!(silent_s(&[(4.0, 2.0, 0.02, false), (0.2, 2.0, 0.02, true), (4.0, 2.0, 0.02, false)]), None);
    }

    #[test]
    fn uncertain_seconds_and_false_alarms_are_counted() {
        let sweeps = drive(&[(5.0, 0.1, 0.02, false), (6.0, 0.1, 0.02, true), (5.0, 0.1, 0.02, false)]);
        assert!((uncertain_s(&sweeps) - 6.0).abs() < 0.01);
        assert!(has_false_alarm(&sweeps));
        assert!(!has_false_alarm(&drive(&[(5.0, 0.1, 0.02, true), (1.0, 0.2, 0.02, true)])));
        assert!(!has_false_alarm(&drive(&[(4.0, 0.1, 0.02, true), (5.0, 0.1, 0.02, false)])));
        assert!((driven_m(&sweeps, 10.0) - 3.0).abs() < 0.04);
    }

    #[test]
    fn intervals_are_those_of_the_events() {
        let time = |seconds| Timestamp::default() + Duration::from_secs_f64(seconds);
        let event = |at, since, change| LocalizationEvent { at: time(at), since: time(since), change };
        let lost = |at, since| event(at, since, LocalizationChange::Lost);
        let events = [lost(10.0, 8.0), event(12.0, 7.0, LocalizationChange::Trusted), lost(20.0, 19.0)];
        let flags = [6.9, 7.5, 9.0, 11.0, 12.1, 18.9, 19.1, 100.0].map(|at| is_uncertain(&events, time(at)));
        assert_eq!(flags, [false, true, true, true, false, false, true, true]);
    }
}
