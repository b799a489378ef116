//! A snapshot of the session as topics and payloads.

use super::names::Names;
use serde_json::json;
use slamd_core::{FaultEvent, ModelEvent, SensorState, Snapshot};

/// Topic and payload of everything in the snapshot except the map.
pub(super) fn messages(names: &Names, snapshot: &Snapshot) -> Vec<(String, String)> {
    let mut messages = vec![
        (names.topic("link"), snapshot.link.word().to_owned()),
        (names.topic("link/attributes"), json!({ "cause": snapshot.cause }).to_string()),
    ];
    if let Some(estimate) = &snapshot.estimate {
        let pose = estimate.pose;
        let payload = json!({
            "x_m": rounded(pose.x_m, 100.0),
            "y_m": rounded(pose.y_m, 100.0),
            "heading_deg": rounded(pose.theta_rad.to_degrees(), 10.0),
        });
        messages.push((names.topic("pose"), payload.to_string()));
        messages.push((names.topic("position_uncertain"), word(snapshot.is_lost)));
    }
    if snapshot.estimate.is_some() || snapshot.doubted_models().next().is_some() {
        let findings: Vec<String> = snapshot.doubted_models().map(ModelEvent::sentence).collect();
        messages.push((names.topic("configuration_doubtful"), word(!findings.is_empty())));
        let attributes = json!({ "findings": findings }).to_string();
        messages.push((names.topic("configuration_doubtful/attributes"), attributes));
    }
    if !snapshot.ring.is_empty() {
        messages.push((names.topic("faulty_sensors"), snapshot.faulty().count().to_string()));
    }
    for sensor in 0..snapshot.ring.len() {
        let fault = snapshot.faulty().find(|change| change.sensor == sensor);
        let topic = names.topic(&format!("sensor/{sensor}"));
        messages.push((format!("{topic}/attributes"), attributes(fault)));
        messages.push((topic, word(fault.is_some())));
    }
    messages
}

/// A sensor's state and the fault's reason, as JSON.
fn attributes(fault: Option<&FaultEvent>) -> String {
    let state = match fault.map(|fault| fault.state) {
        Some(SensorState::Faulty(kind)) => kind.word(),
        Some(SensorState::Healthy) | None => "healthy",
    };
    json!({ "state": state, "reason": fault.map_or("", |fault| &fault.reason) }).to_string()
}

/// The payload of a binary sensor in Home Assistant.
fn word(is_on: bool) -> String {
    if is_on { "ON" } else { "OFF" }.into()
}

/// A number for people, to a tenth.
pub(super) fn tenths(value: f64) -> String {
    format!("{:.1}", value + 0.0)
}

/// Rounds to `1 / parts`, so that a robot at rest is published once. Adding 0.0 removes the sign of zero.
fn rounded(value: f64, parts: f64) -> f64 {
    libm::round(value * parts) / parts + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use slamd_core::{Estimate, FaultKind, ModelAspect, ModelFinding, ModelState, Pose2, Ring, Timestamp};

    #[test]
    fn only_known_values_are_published() {
        let names = Names::new("robot");
        let mut snapshot = Snapshot { cause: "port missing".into(), ..Snapshot::default() };
        let found = messages(&names, &snapshot);
        assert_eq!(found[0], ("slamd/robot/link".into(), "searching".into()));
        assert_eq!(found[1].1, r#"{"cause":"port missing"}"#);
        assert_eq!(found.len(), 2);

        snapshot.ring = Ring::circle(2, 0.1, 0.1, 1);
        let (at, state) = (Timestamp::default(), SensorState::Faulty(FaultKind::Stuck));
        snapshot.changes = vec![None, Some(FaultEvent { at, sensor: 1, state, reason: "always 1 m".into() })];
        snapshot.is_lost = true;
        snapshot.estimate = Some(Estimate {
            at,
            sweep: 1,
            pose: Pose2::new(1.234, -0.001, std::f64::consts::FRAC_PI_3),
            covariance: Matrix3::zeros(),
            odometry: Pose2::default(),
            nis: 1.0,
        });
        let finding = ModelFinding {
            aspect: ModelAspect::TurnSign,
            measured: -1.0,
            sigma: 0.0,
            clause: "the wheels turn the other way".into(),
            remedies: Vec::new(),
        };
        snapshot.models = vec![ModelEvent { at, since: at, finding, state: ModelState::Doubted }];
        let found: Vec<_> = messages(&names, &snapshot).into_iter().skip(2).collect();
        let expected = [
            ("pose", r#"{"heading_deg":60.0,"x_m":1.23,"y_m":0.0}"#),
            ("position_uncertain", "ON"),
            ("configuration_doubtful", "ON"),
            (
                "configuration_doubtful/attributes",
                r#"{"findings":["the wheels turn the other way; poses are uncertain"]}"#,
            ),
            ("faulty_sensors", "1"),
            ("sensor/0/attributes", r#"{"reason":"","state":"healthy"}"#),
            ("sensor/0", "OFF"),
            ("sensor/1/attributes", r#"{"reason":"always 1 m","state":"stuck"}"#),
            ("sensor/1", "ON"),
        ];
        assert_eq!(found, expected.map(|(topic, payload)| (names.topic(topic), payload.to_owned())));
    }
}
