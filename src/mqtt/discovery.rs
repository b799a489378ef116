//! Discovery messages for Home Assistant: one device with its map, pose, link and sensors.
//!
//! <https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery>; `tests/doors/mqtt.rs` checks the required keys.

use super::names::Names;
use serde_json::{Value, json};
use slamd_core::link::LinkState;
use slamd_protocol::MAX_SENSORS;

/// Topic and payload of each entity's description for a ring of `sensors`, 0 while the ring is unknown. Sensors beyond the ring get an empty
/// payload, which removes entities that an earlier ring left behind.
#[must_use]
pub fn discovery(names: &Names, sensors: usize) -> Vec<(String, String)> {
    let mut messages = vec![map(names)];
    messages.extend(pose(names));
    messages.extend(drive(names));
    messages.push(link(names));
    messages.push(position(names));
    messages.push(configuration(names));
    messages.extend((0..sensors).map(|sensor| self::sensor(names, sensor)));
    if sensors > 0 {
        let surplus =
            (sensors..MAX_SENSORS).map(|sensor| names.config_topic("binary_sensor", &format!("sensor_{sensor}")));
        messages.extend(surplus.map(|topic| (topic, String::new())));
    }
    messages
}

fn map(names: &Names) -> (String, String) {
    let map = json!({ "name": "Map", "image_topic": names.topic("map"), "content_type": "image/png" });
    entity(names, "image", "map", map)
}

fn pose(names: &Names) -> [(String, String); 3] {
    let coordinate = |id: &str, name: &str| {
        let coordinate = json!({
            "name": name,
            "state_topic": names.topic("pose"),
            "value_template": format!("{{{{ value_json.{id}_m }}}}"),
            "unit_of_measurement": "m",
            "device_class": "distance",
            "state_class": "measurement",
        });
        entity(names, "sensor", id, coordinate)
    };
    let heading = json!({
        "name": "Heading",
        "state_topic": names.topic("pose"),
        "value_template": "{{ value_json.heading_deg }}",
        "unit_of_measurement": "°",
        "icon": "mdi:compass",
    });
    [coordinate("x", "X"), coordinate("y", "Y"), entity(names, "sensor", "heading", heading)]
}

/// What people ask of a drive: how large, how far, and how many sensors are broken.
fn drive(names: &Names) -> [(String, String); 3] {
    let number = |id: &str, name: &str, unit: Option<&str>, class: Option<&str>, icon: &str| {
        let mut number = json!({
            "name": name,
            "state_topic": names.topic(id),
            "state_class": "measurement",
            "icon": icon,
        });
        if let Some((unit, class)) = unit.zip(class) {
            (number["unit_of_measurement"], number["device_class"]) = (unit.into(), class.into());
        }
        entity(names, "sensor", id, number)
    };
    [
        number("area", "Area", Some("m²"), Some("area"), "mdi:floor-plan"),
        number("distance", "Distance", Some("m"), Some("distance"), "mdi:map-marker-distance"),
        number("faulty_sensors", "Faulty sensors", None, None, "mdi:alert-circle-outline"),
    ]
}

fn link(names: &Names) -> (String, String) {
    let link = json!({
        "name": "Link",
        "state_topic": names.topic("link"),
        "json_attributes_topic": names.topic("link/attributes"),
        "device_class": "enum",
        "options": LinkState::ALL.map(LinkState::word),
        "entity_category": "diagnostic",
    });
    entity(names, "sensor", "link", link)
}

fn position(names: &Names) -> (String, String) {
    let position = json!({
        "name": "Position uncertain",
        "state_topic": names.topic("position_uncertain"),
        "device_class": "problem",
    });
    entity(names, "binary_sensor", "position_uncertain", position)
}

fn configuration(names: &Names) -> (String, String) {
    let configuration = json!({
        "name": "Configuration doubtful",
        "state_topic": names.topic("configuration_doubtful"),
        "json_attributes_topic": names.topic("configuration_doubtful/attributes"),
        "device_class": "problem",
        "entity_category": "diagnostic",
    });
    entity(names, "binary_sensor", "configuration_doubtful", configuration)
}

fn sensor(names: &Names, sensor: usize) -> (String, String) {
    let description = json!({
        "name": format!("Sensor {sensor}"),
        "state_topic": names.topic(&format!("sensor/{sensor}")),
        "json_attributes_topic": names.topic(&format!("sensor/{sensor}/attributes")),
        "device_class": "problem",
        "entity_category": "diagnostic",
    });
    entity(names, "binary_sensor", &format!("sensor_{sensor}"), description)
}

/// Adds the keys that all entities share.
fn entity(names: &Names, component: &str, id: &str, mut description: Value) -> (String, String) {
    description["unique_id"] = format!("{}_{id}", names.device()).into();
    description["availability_topic"] = names.topic("availability").into();
    description["device"] = json!({
        "identifiers": [names.device()],
        "name": names.title,
        "manufacturer": "slamd",
        "model": "ring of ultrasonic sensors",
        "sw_version": env!("CARGO_PKG_VERSION"),
    });
    description["origin"] = json!({ "name": "slamd", "sw_version": env!("CARGO_PKG_VERSION") });
    (names.config_topic(component, id), description.to_string())
}
