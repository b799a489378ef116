//! In what the robot differs from its configuration, for `summary.json`.

use serde::Serialize;
use slamd_core::{ModelAspect, ModelEvent, ModelState};

/// One way in which the robot differs, or differed, from its configuration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelReport {
    /// The aspect's word, such as `wheel_scale`.
    pub name: &'static str,
    /// The sensor, where it is about one.
    pub sensor: Option<usize>,
    /// The configuration key that mends it; none if no key does.
    pub key: Option<&'static str>,
    /// Its value, as in TOML.
    pub value: Option<String>,
    /// Further keys that would explain the echoes as well.
    pub alternatives: Vec<Remedy>,
    /// By how much: a factor, degrees or metres.
    pub measured: f64,
    /// One standard deviation of it.
    pub sigma: f64,
    /// `doubted`, `corrected` or `resolved`.
    pub state: &'static str,
    /// The first instant whose data show it, seconds of the session.
    pub since_s: f64,
    /// When it was over; none if it lasted to the end.
    pub until_s: Option<f64>,
    /// True if it was over before the end.
    pub resolved: bool,
    /// The newest event in words.
    pub text: String,
    #[serde(skip)]
    aspect: ModelAspect,
}

/// A configuration key and its value, as in TOML.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Remedy {
    /// The key.
    pub key: &'static str,
    /// Its value.
    pub value: String,
}

impl ModelReport {
    fn new(event: &ModelEvent) -> Self {
        let finding = &event.finding;
        let mut remedies = finding.remedies.iter().map(|(key, value)| Remedy { key, value: value.clone() });
        let (key, value) = remedies.next().map(|Remedy { key, value }| (key, value)).unzip();
        let resolved = event.state == ModelState::Resolved;
        Self {
            name: finding.aspect.word(),
            sensor: if let ModelAspect::SensorBearing(sensor) = finding.aspect { Some(sensor) } else { None },
            key,
            value,
            alternatives: remedies.collect(),
            measured: finding.measured,
            sigma: finding.sigma,
            state: event.state.word(),
            since_s: event.since.seconds(),
            until_s: resolved.then(|| event.at.seconds()),
            resolved,
            text: event.sentence(),
            aspect: finding.aspect,
        }
    }
}

/// Adds an event: it changes the open report of its aspect, or begins one. The number of reports is bounded.
pub(super) fn take(reports: &mut Vec<ModelReport>, event: &ModelEvent) {
    let report = ModelReport::new(event);
    let is_full = reports.len() >= MAX_REPORTS;
    let open = reports.iter_mut().find(|open| open.aspect == report.aspect && !open.resolved);
    match open {
        Some(open) => *open = ModelReport { since_s: open.since_s.min(report.since_s), ..report },
        None if !report.resolved && !is_full => reports.push(report),
        None => {}
    }
}

/// A finding that comes and goes all the time says no more.
const MAX_REPORTS: usize = 1_000;

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{ModelFinding, Timestamp};

    #[test]
    fn a_finding_is_one_report_until_it_is_resolved() {
        let event = |at_s: u64, aspect, state| {
            let at = Timestamp::from_us(1_000_000 * at_s);
            let remedies = vec![("robot.ticks_per_turn", "1440".into()), ("robot.wheel_radius_m", "0.03".into())];
            let clause = "the wheels report too much".into();
            ModelEvent {
                at,
                since: at,
                finding: ModelFinding { aspect, measured: 4.0, sigma: 0.1, clause, remedies },
                state,
            }
        };
        let mut reports = Vec::new();
        for (at_s, aspect, state) in [
            (5, ModelAspect::SensorBearing(3), ModelState::Resolved),
            (10, ModelAspect::WheelScale, ModelState::Doubted),
            (12, ModelAspect::SensorBearing(3), ModelState::Doubted),
            (20, ModelAspect::WheelScale, ModelState::Corrected),
            (30, ModelAspect::WheelScale, ModelState::Resolved),
            (40, ModelAspect::WheelScale, ModelState::Doubted),
        ] {
            take(&mut reports, &event(at_s, aspect, state));
        }
        let told: Vec<_> = reports.iter().map(|it| (it.name, it.sensor, it.since_s, it.until_s)).collect();
        assert_eq!(
            told,
            [
                ("wheel_scale", None, 10.0, Some(30.0)),
                ("sensor_bearing", Some(3), 12.0, None),
                ("wheel_scale", None, 40.0, None)
            ]
        );
        assert_eq!((reports[0].key, reports[0].alternatives.len()), (Some("robot.ticks_per_turn"), 1));
    }
}
