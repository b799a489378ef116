//! The robot in Home Assistant: Debian's mosquitto is the broker, and `mosquitto_sub` receives what Home Assistant would.

#![allow(clippy::unwrap_used, reason = "a test may")]

use serde_json::Value;
use slamd_testkit::mock_port::Board;
use slamd_testkit::mosquitto::{Mosquitto, Subscriber};
use slamd_testkit::served::{SOON, Served};
use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::fs::PermissionsExt as _;

/// The keys without which Home Assistant takes no entity of a component: its documentation of the MQTT integrations, 2025. Of `device` it demands an
/// identifier, of `origin` a name; with a `unique_id` an entity can be renamed, and with all three together they are one device.
const REQUIRED: &[(&str, &[&str])] =
    &[("image", &["image_topic"]), ("sensor", &["state_topic"]), ("binary_sensor", &["state_topic"])];
/// The device classes that it knows, of those that are used, with the units that it takes for them.
const CLASSES: &[(&str, &str, &[&str])] = &[
    ("sensor", "distance", &["m"]),
    ("sensor", "area", &["m²"]),
    ("sensor", "enum", &[]),
    ("binary_sensor", "problem", &[]),
];

/// The descriptions of all entities, by topic.
fn descriptions(told: &BTreeMap<String, Vec<u8>>) -> BTreeMap<String, Value> {
    let is_config = |topic: &str| topic.starts_with("homeassistant/") && topic.ends_with("/config");
    let configs = told.iter().filter(|(topic, payload)| is_config(topic) && !payload.is_empty());
    configs.map(|(topic, payload)| (topic.clone(), serde_json::from_slice(payload).unwrap())).collect()
}

/// What Home Assistant would have against a description.
fn complaints(topic: &str, description: &Value, told: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    let mut complaints = Vec::new();
    let component = topic.split('/').nth(1).unwrap();
    let Some((_, required)) = REQUIRED.iter().find(|(known, _)| *known == component) else {
        return vec![format!("{topic}: there is no component {component}")];
    };
    for key in required.iter().chain(&["name", "unique_id", "availability_topic"]) {
        if description[key].as_str().is_none_or(str::is_empty) {
            complaints.push(format!("{topic}: lacks {key}"));
        }
    }
    if description["device"]["identifiers"][0].as_str().is_none() || description["origin"]["name"].as_str().is_none() {
        complaints.push(format!("{topic}: belongs to nobody"));
    }
    let named = description.as_object().unwrap().iter().filter(|(key, _)| key.ends_with("_topic"));
    let silent = named.filter(|(_, named)| !told.contains_key(named.as_str().unwrap()));
    complaints.extend(silent.map(|(key, named)| format!("{topic}: {key}: nothing is published at {named}")));
    if let Some(class) = description["device_class"].as_str() {
        let unit = description["unit_of_measurement"].as_str();
        let is_known = CLASSES.iter().any(|(of, known, units)| {
            *of == component && *known == class && unit.map_or(units.is_empty(), |unit| units.contains(&unit))
        });
        if !is_known {
            complaints.push(format!("{topic}: no class {class} in {unit:?}"));
        }
    }
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !topic.split('/').skip(2).all(|id| !id.is_empty() && id.chars().all(plain)) {
        complaints.push(format!("{topic}: an id is not plain"));
    }
    complaints
}

#[test]
fn home_assistant_finds_the_robot_and_its_end() {
    let broker = Mosquitto::start(None);
    let served = Served::new(&["--mqtt", &broker.address()]);
    let mut subscriber = Subscriber::new(&broker, None);
    subscriber.expect("slamd/robot/link", b"searching", SOON);
    let _board = served.plug_in(Board::broken(1, &["3:missing"]));
    subscriber.expect("slamd/robot/link", b"streaming", SOON);
    subscriber.expect("slamd/robot/sensor/3", b"ON", SOON);
    subscriber.until(SOON, |it| it.told.contains_key("slamd/robot/map"));
    // The first pose comes before the robot has driven.
    let is_driven = |payload: &Vec<u8>| !["0", "0.0"].map(str::as_bytes).contains(&&payload[..]);
    subscriber.until(SOON, |it| it.told.get("slamd/robot/distance").is_some_and(is_driven));

    // Messages are retained, so later subscribers receive them too; not the empty ones, which remove the sensors of a larger ring.
    let mut late = Subscriber::new(&broker, None);
    let has = |late: &Subscriber| {
        let kept = subscriber.told.iter().filter(|(_, payload)| !payload.is_empty());
        kept.into_iter().all(|(topic, _)| late.retained.contains_key(topic))
    };
    late.until(SOON, has);
    let told = late.retained.clone();
    let descriptions = descriptions(&told);
    let found: Vec<_> = descriptions.iter().flat_map(|(topic, it)| complaints(topic, it, &told)).collect();
    assert!(found.is_empty(), "\n{}", found.join("\n"));
    assert_eq!(descriptions.len(), 1 + 3 + 3 + 1 + 1 + 1 + 32, "{:?}", descriptions.keys());
    let distinct = |key: fn(&Value) -> String| descriptions.values().map(key).collect::<BTreeSet<_>>().len();
    assert_eq!(distinct(|it| it["unique_id"].to_string()), descriptions.len());
    assert_eq!(distinct(|it| it["device"].to_string()), 1, "they are one device");

    check_states(&descriptions, &told);
    check_picture(&told["slamd/robot/map"]);

    // SIGKILL: the broker says what slamd no longer can.
    assert_eq!(subscriber.told["slamd/robot/availability"], b"online");
    drop(served.daemon);
    subscriber.expect("slamd/robot/availability", b"offline", SOON);
}

/// The states are what the descriptions promise.
fn check_states(descriptions: &BTreeMap<String, Value>, told: &BTreeMap<String, Vec<u8>>) {
    let text = |what: &str| String::from_utf8(told[&format!("slamd/robot/{what}")].clone()).unwrap();
    let options = &descriptions["homeassistant/sensor/slamd_robot/link/config"]["options"];
    assert!(options.as_array().unwrap().contains(&text("link").into()), "{options}");
    let pose: Value = serde_json::from_str(&text("pose")).unwrap();
    for entity in ["x", "y", "heading"] {
        let description = &descriptions[&format!("homeassistant/sensor/slamd_robot/{entity}/config")];
        let template = description["value_template"].as_str().unwrap();
        let key = template.trim_start_matches("{{ value_json.").trim_end_matches(" }}");
        assert!(pose[key].is_number(), "{template} in {pose}");
    }
    assert_eq!(text("position_uncertain"), "OFF");
    assert_eq!(text("configuration_doubtful"), "OFF");
    assert_eq!(text("configuration_doubtful/attributes"), "{\"findings\":[]}");
    let faulty: Vec<usize> = (0..32).filter(|sensor| text(&format!("sensor/{sensor}")) == "ON").collect();
    assert_eq!(faulty, [3]);
    assert_eq!(text("faulty_sensors"), "1");
    let number = |what: &str| text(what).parse::<f64>().unwrap();
    assert!(number("distance") > 0.0 && number("area") >= 0.0, "{} m, {} m2", number("distance"), number("area"));
    let why: Value = serde_json::from_str(&text("sensor/3/attributes")).unwrap();
    assert!(why["state"] == "missing" && !why["reason"].as_str().unwrap().is_empty(), "{why}");
    let cause: Value = serde_json::from_str(&text("link/attributes")).unwrap();
    assert!(cause["cause"].as_str().unwrap().contains("baud"), "{cause}");
}

/// It is a picture with floor, walls and legend in it.
fn check_picture(file: &[u8]) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert!(info.width >= 1000 && info.height >= 500, "{} x {}", info.width, info.height);
    let samples = pixels.len() / (info.width * info.height) as usize;
    let colours: BTreeSet<&[u8]> = pixels.chunks_exact(samples).collect();
    assert!(colours.len() > 20, "{} colours", colours.len());
}

#[test]
fn a_broker_that_restarts_gets_everything_again() {
    let broker = Mosquitto::start(None);
    let port = broker.port();
    let mut served = Served::new(&["--mqtt", &broker.address()]);
    served.daemon.expect("mqtt: connected to", SOON);
    Subscriber::new(&broker, None).expect("slamd/robot/link", b"searching", SOON);
    drop(broker);
    served.daemon.expect("retrying", SOON);
    let broker = Mosquitto::start(Some(port));
    served.daemon.expect("mqtt: connected to", SOON);
    let mut subscriber = Subscriber::new(&broker, None);
    subscriber.expect("slamd/robot/availability", b"online", SOON);
    subscriber.expect("slamd/robot/link", b"searching", SOON);
    assert!(subscriber.told.contains_key("homeassistant/image/slamd_robot/map/config"), "{:?}", subscriber.told.keys());
    served.daemon.end();
    subscriber.expect("slamd/robot/availability", b"offline", SOON);
    // Nobody there is no reason to wait at the end.
    drop(broker);
    let served = Served::new(&["--mqtt", &format!("127.0.0.1:{port}"), "--duration", "0.3"]);
    served.daemon.wait();
}

const PASSWORD: &str = "correct-horse-battery-staple";

#[test]
fn the_password_is_for_the_broker_alone() {
    let broker = Mosquitto::with_password("slamd", PASSWORD);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, password: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{password}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (right, wrong) = (write("right", PASSWORD), write("wrong", "guessed"));
    let options = |file| {
        ["--mqtt".into(), broker.address(), "--mqtt-user".into(), "slamd".into(), "--mqtt-password-file".into(), file]
    };
    let start = |file: &str| {
        let options: [String; 6] = options(file.to_owned());
        Served::with(&options.each_ref().map(String::as_str), &[("RUST_LOG", "trace")])
    };
    let mut refused = start(&wrong);
    refused.daemon.expect("user or password refused", SOON);
    let mut served = start(&right);
    served.daemon.expect("mqtt: connected to", SOON);
    let mut subscriber = Subscriber::new(&broker, Some(("slamd", PASSWORD)));
    subscriber.expect("slamd/robot/availability", b"online", SOON);
    let arguments = std::fs::read(format!("/proc/{}/cmdline", served.daemon.pid())).unwrap();
    assert!(!String::from_utf8_lossy(&arguments).contains(PASSWORD));
    // Even its MQTT library's own words, which are in this log, do not have it.
    served.daemon.expect("Publish. Topic = slamd/robot/availability", SOON);
    assert!(!served.daemon.has_said(PASSWORD), "the log has the password");
    served.daemon.end();
    std::fs::set_permissions(&right, std::fs::Permissions::from_mode(0o644)).unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_slamd"));
    let open = command.args(["--port", "nowhere"]).args(options(right)).output().unwrap();
    let words = String::from_utf8(open.stderr).unwrap();
    assert!(open.status.code() == Some(78) && words.contains("chmod 600"), "{words}");
}
