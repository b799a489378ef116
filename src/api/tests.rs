//! Tests of one client with simulated time.

use super::mailbox::Mailbox;
use super::{Client, End, Report, Snapshot, Tap, Token};
use bytes::Bytes;
use nalgebra::Matrix3;
use serde_json::Value;
use slamd_core::{
    Estimate, FaultEvent, FaultKind, ModelAspect, ModelEvent, ModelFinding, ModelState, Pose2, SensorState, Timestamp,
    link::Link,
};
use std::sync::Arc;

fn at(ms: u64) -> Timestamp {
    Timestamp::from_us(1_000 * ms)
}

/// Reads all waiting lines: the class of each line and the line.
fn taken(client: &mut Client, ms: u64) -> Vec<(String, Value)> {
    let mut text = Vec::new();
    while !client.outgoing().is_empty() {
        // Small pieces, which do not end at line feeds.
        let count = client.outgoing().len().min(7);
        text.extend_from_slice(&client.outgoing()[..count]);
        client.wrote(at(ms), count);
    }
    let lines = String::from_utf8(text).unwrap();
    let lines = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.map(|line| (line["class"].as_str().unwrap().into(), line)).collect()
}

fn classes(client: &mut Client, ms: u64) -> Vec<String> {
    taken(client, ms).into_iter().map(|(class, _)| class).collect()
}

/// A snapshot with sweep number `sweep`.
fn snapshot(sweep: u64) -> Snapshot {
    let at = at(100 * sweep);
    let pose = Pose2::new(1.0, 2.0, 0.5);
    let estimate = Estimate { at, sweep, pose, covariance: Matrix3::identity(), odometry: pose, nis: f64::NAN };
    Snapshot {
        at,
        sweep: Some(sweep),
        sweep_at: at,
        ranges_m: vec![1.25, f64::INFINITY, f64::NEG_INFINITY, f64::NAN],
        estimate: Some(estimate),
        ..Snapshot::default()
    }
}

fn fault(sensor: usize, state: SensorState) -> Option<FaultEvent> {
    Some(FaultEvent { at: at(1), sensor, state, reason: "it is so".into() })
}

fn watching(request: &str) -> Client {
    let mut client = Client::new(at(0), None);
    client.received(at(0), request.as_bytes());
    assert_eq!(classes(&mut client, 0), ["VERSION", "WATCH"]);
    client
}

#[test]
fn poses_come_at_the_rate_asked_for() {
    for (hz, expected) in [(50.0, 100), (10.0, 100), (4.0, 40), (1.0, 10), (0.0, 0)] {
        let mut client = watching(&format!("?WATCH={{\"pose_hz\":{hz}}};\n"));
        let mut poses = 0;
        for sweep in 1..=100 {
            // Ten sweeps a second, up to 20 ms late.
            let ms = 100 * sweep + 7 * sweep % 21;
            client.tick(at(ms));
            client.update(at(ms), &snapshot(sweep), 1);
            poses += classes(&mut client, ms).iter().filter(|class| *class == "POSE").count();
        }
        assert!(poses.abs_diff(expected) <= 1, "{hz} Hz: {poses} poses in 10 s");
    }
}

#[test]
fn what_is_no_number_in_json_is_a_word_or_null() {
    let mut client = watching("?WATCH={\"pose_hz\":10,\"sweep_hz\":10};\n");
    client.update(at(100), &snapshot(1), 1);
    let lines = taken(&mut client, 100);
    let line = |class: &str| &lines.iter().find(|(found, _)| found == class).unwrap().1;
    assert_eq!(line("SWEEP")["ranges_m"].to_string(), r#"[1.25,"clear","near",null]"#);
    assert_eq!(line("POSE")["nis"], Value::Null);
}

#[test]
fn each_fault_is_reported_once_and_a_new_watcher_gets_the_present_ones() {
    let mut client = watching("?WATCH={\"pose_hz\":0};\n");
    let mut snapshot = snapshot(1);
    snapshot.changes = vec![None, fault(1, SensorState::Faulty(FaultKind::Stuck)), fault(2, SensorState::Healthy)];
    client.update(at(100), &snapshot, 1);
    assert_eq!(classes(&mut client, 100), ["DEVICE", "FAULT"], "a fault that has passed is not reported");
    client.update(at(200), &snapshot, 1);
    assert!(classes(&mut client, 200).is_empty(), "nothing has changed");
    snapshot.changes[1] = fault(1, SensorState::Healthy);
    client.update(at(300), &snapshot, 1);
    assert_eq!(taken(&mut client, 300)[0].1["state"], "healthy");
    client.received(at(400), b"?POLL;\n");
    client.update(at(400), &snapshot, 1);
    assert_eq!(classes(&mut client, 400), ["DEVICE", "SWEEP", "POSE", "STATS"]);
}

#[test]
fn a_map_is_asked_for_when_it_is_due() {
    let mut client = watching("?WATCH={\"map_hz\":0.5};\n");
    let line = Bytes::from_static(b"{\"class\":\"MAP\"}\n");
    let mut maps = Vec::new();
    for ms in (0..10_000).step_by(100) {
        client.tick(at(ms));
        if client.pending().map {
            client.map(at(ms), Some(&line));
        }
        maps.extend(classes(&mut client, ms).iter().map(|_| ms));
        assert!(client.deadline() > at(ms), "it does not spin");
    }
    assert!((5..=6).contains(&maps.len()), "{maps:?}");
    // A map that another client requested is not sent.
    client.map(at(10_000), Some(&line));
    assert!(classes(&mut client, 10_000).is_empty());
}

#[test]
fn a_client_that_reads_nothing_is_dropped_with_a_notice_after_the_current_line() {
    let mut client = watching("?WATCH={\"sweep_hz\":50};\n");
    client.update(at(0), &snapshot(0), 1);
    client.wrote(at(0), 3);
    let begun = client.outgoing().to_vec();
    for sweep in 1.. {
        client.update(at(100), &snapshot(sweep), 1);
        client.received(at(100), b"?VERSION;\n?VERSION;\n?VERSION;\n?VERSION;\n");
        if client.end().is_some() {
            break;
        }
        assert!(sweep < 5_000, "the queue has no bound");
    }
    assert_eq!(client.end(), Some(End::Slow));
    assert_eq!(client.outgoing(), begun, "a partly written line is not cut");
    client.wrote(at(100), begun.len());
    assert!(taken(&mut client, 100)[0].1["message"].as_str().unwrap().contains("too slow"));
    assert!(client.is_over(at(100)));

    let mut client = watching("?WATCH;\n");
    client.received(at(0), b"?VERSION;\n");
    client.tick(at(9_999));
    assert_eq!(client.end(), None);
    client.tick(client.deadline());
    assert_eq!(client.end(), Some(End::Slow), "the client is stalled");
    assert!(!client.is_over(at(14_999)) && client.is_over(at(15_000)), "the last line has a time limit");
}

#[test]
fn a_line_has_a_maximum_length() {
    for pieces in [1, 1_000, 65_536] {
        let mut client = Client::new(at(0), None);
        taken(&mut client, 0);
        for piece in vec![b'x'; 65_536].chunks(pieces) {
            client.received(at(0), piece);
        }
        assert_eq!(client.end(), None, "64 KiB are allowed");
        client.received(at(0), b"x");
        assert_eq!(client.end(), Some(End::LineTooLong));
        assert!(taken(&mut client, 0)[0].1["message"].as_str().unwrap().contains("65536 bytes"));
    }
}

#[test]
fn a_client_without_the_token_gets_nothing_and_is_dropped() {
    let token = Some(Token::new("0123456789abcdef"));
    let mut client = Client::new(at(0), token);
    assert!(client.outgoing().is_empty(), "nothing is sent before the token");
    client.received(at(0), b"?WATCH;\n?TOKEN=\"0123456789abcdef\";\n?WATCH;\n");
    assert_eq!(classes(&mut client, 0), ["ERROR", "VERSION", "WATCH"]);
    client.tick(at(6_000));
    assert_eq!(client.end(), None, "the client is authenticated now");

    let mut client = Client::new(at(0), token);
    client.received(at(0), b"?TOKEN=\"0123456789abcdee\";\n?POLL;\nGET / HTTP/1.1\n?TOKEN=\"0123456789abcdef\";\n");
    assert_eq!(client.end(), Some(End::Unauthorized), "the fourth attempt is too late");
    assert!(!client.pending().snapshot);

    let mut client = Client::new(at(0), token);
    assert_eq!(client.deadline(), at(5_000));
    client.tick(at(5_000));
    assert_eq!(client.end(), Some(End::Unauthorized));
}

#[test]
fn an_idle_client_is_dropped_and_a_watching_one_is_not() {
    let mut idle = Client::new(at(0), None);
    taken(&mut idle, 0);
    idle.received(at(15_000), b"nonsense\n");
    taken(&mut idle, 15_000);
    idle.tick(at(34_999));
    assert_eq!(idle.end(), None);
    idle.tick(idle.deadline());
    assert_eq!(idle.end(), Some(End::Idle));
    let mut client = watching("?WATCH;\n");
    client.tick(at(3_000_000));
    assert_eq!(client.end(), None);
}

#[test]
fn a_request_is_answered_after_the_client_closed_its_side() {
    let mut client = Client::new(at(0), None);
    client.received(at(0), b"?POLL;\n");
    client.peer_closed(at(0));
    assert_eq!(client.end(), None);
    client.update(at(100), &snapshot(1), 1);
    assert_eq!(client.end(), Some(End::Done));
    assert!(!client.is_over(at(100)));
    assert_eq!(classes(&mut client, 100).last().unwrap(), "STATS");
    assert!(client.is_over(at(100)));
}

#[test]
fn differences_from_the_configuration_are_news_once() {
    let event = |state| {
        let (clause, remedies) = ("the wheels report too much".into(), vec![("robot.ticks_per_turn", "1440".into())]);
        let finding = ModelFinding { aspect: ModelAspect::WheelScale, measured: 4.0, sigma: 0.1, clause, remedies };
        ModelEvent { at: at(1), since: at(0), finding, state }
    };
    let told = |client: &mut Client, ms, state| {
        client.update(at(ms), &Snapshot { models: vec![event(state)], ..snapshot(ms / 100) }, 1);
        let lines = taken(client, ms).into_iter().filter(|(class, _)| class == "MODEL");
        lines.map(|(_, line)| line["state"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let mut client = watching("?WATCH;\n");
    assert_eq!(told(&mut client, 100, ModelState::Doubted), ["doubted"]);
    assert!(told(&mut client, 200, ModelState::Doubted).is_empty());
    assert_eq!(told(&mut client, 300, ModelState::Resolved), ["resolved"]);
    let mut late = watching("?WATCH;\n");
    assert!(told(&mut late, 400, ModelState::Resolved).is_empty());
    assert_eq!(told(&mut late, 500, ModelState::Corrected), ["corrected"]);
    late.received(at(500), b"?POLL;\n");
    assert_eq!(told(&mut late, 600, ModelState::Corrected), ["corrected"]);
}

#[test]
fn every_report_is_one_line() {
    let message = "a\nb\u{1b}[2J";
    let line = Report::Error { message }.line();
    assert_eq!(line.iter().filter(|byte| **byte < b' ').count(), 1, "{line:?}");
    assert!(line.ends_with(b"\n"));
}

#[test]
fn the_pipelines_thread_copies_on_request_and_never_waits() {
    let mailbox = Arc::<Mailbox>::default();
    let mut tap = Tap::new(Arc::clone(&mailbox), "robot".into());
    let mut link = Link::new(115_200);
    link.closed(at(0), "no port");
    let seen = || mailbox.open().unwrap().0.snapshot.cause.clone();
    tap.look(&link, None);
    assert_eq!(seen(), "", "there is no request");
    let busy = mailbox.open();
    mailbox.ask();
    tap.look(&link, None);
    drop(busy);
    assert!(mailbox.is_requested(), "the server held the lock: the request stays open");
    tap.look(&link, None);
    assert!(!mailbox.is_requested());
    assert_eq!(seen(), "no port");
}
