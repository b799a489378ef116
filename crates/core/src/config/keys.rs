//! All keys of the configuration: for the check, the schema and the environment variables.
//!
//! The defaults are in the types, not here.

use super::calibration::SIGMA_FLOOR;
use super::shape::Shape;
use slamd_protocol::Setting;

/// Maximum number of sensors: a `SONAR` message holds no more.
pub(super) const MAX_SENSORS: u8 = 76;

/// One key.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Its name in its table.
    pub name: &'static str,
    /// Its meaning and unit, in one sentence.
    pub about: &'static str,
    /// Its allowed values.
    pub shape: Shape,
    /// True if its table requires it.
    pub is_required: bool,
    /// A key of the same table whose value it must not exceed.
    pub at_most: Option<&'static str>,
    /// A key of the same table that must be absent if this one is given.
    pub instead_of: Option<&'static str>,
}

/// All keys of the configuration.
#[must_use]
pub fn keys() -> Vec<Key> {
    vec![
        key("method", Shape::Choice(&["walls", "paper"]), "How heading, position and map are found."),
        key("robot", Shape::Table(robot()), "The drive."),
        key(
            "ring",
            Shape::Table(ring()),
            "The sensors; their places come from the board where neither `sensors` nor `circle` is given.",
        ),
        key("map", Shape::Table(map()), "The map."),
        key(
            "board",
            Shape::Table(board()),
            "Settings of the board, set where they differ; those not named stay as the board has them.",
        ),
    ]
}

/// The dotted names of all values in the order of [`keys`]. A list counts as one value.
#[must_use]
pub fn values() -> Vec<(String, Key)> {
    let mut found = Vec::new();
    collect("", keys(), &mut found);
    found
}

fn collect(path: &str, keys: Vec<Key>, found: &mut Vec<(String, Key)>) {
    for key in keys {
        let path = joined(path, key.name);
        match key.shape {
            Shape::Table(keys) => collect(&path, keys, found),
            _ => found.push((path, key)),
        }
    }
}

/// A dotted name with one more part.
pub(super) fn joined(path: &str, name: &str) -> String {
    if path.is_empty() { name.into() } else { format!("{path}.{name}") }
}

fn robot() -> Vec<Key> {
    vec![
        key("name", Shape::Text, "The robot's name, shown in logs."),
        number("wheel_radius_m", 0.005, 1.0, "Radius of a driven wheel, metres."),
        number("wheel_base_m", 0.02, 3.0, "Distance between the driven wheels' contact points, metres."),
        number(
            "wheel_base_sigma_m",
            SIGMA_FLOOR,
            0.5,
            "How well wheel_base_m is known: one standard deviation, metres; 2.5 % of it where absent.",
        ),
        number(
            "wheel_ratio",
            0.5,
            2.0,
            "Radius of the right wheel divided by that of the left; the mean of both is wheel_radius_m.",
        ),
        number("wheel_ratio_sigma", SIGMA_FLOOR, 0.2, "How well wheel_ratio is known: one standard deviation."),
        whole("ticks_per_turn", 1, 10_000_000, "Encoder ticks per wheel turn; the board's own value where absent."),
        number("max_speed_m_s", 0.01, 10.0, "Fastest the robot drives, metres per second."),
        number("max_turn_rate_rad_s", 0.01, 30.0, "Fastest the robot turns, radians per second."),
    ]
}

fn ring() -> Vec<Key> {
    vec![
        Key {
            at_most: Some("max_range_m"),
            ..number(
                "min_range_m",
                0.0,
                20.0,
                "Nearest distance a sensor measures, metres; what is nearer is \"too close\".",
            )
        },
        number(
            "max_range_m",
            0.1,
            20.0,
            "Farthest distance a sensor measures, metres; what is farther is \"nothing in range\".",
        ),
        number("temperature_c", -40.0, 85.0, "Air temperature until the board reports one, degrees Celsius."),
        key(
            "circle",
            Shape::Table(circle()),
            "Sensors evenly round a circle, looking outward, instead of the board's geometry.",
        ),
        Key {
            instead_of: Some("circle"),
            ..key("sensors", Shape::List(sensor(), MAX_SENSORS), "Sensors one by one, instead of the board's geometry.")
        },
        key(
            "corrections",
            Shape::List(correction(), MAX_SENSORS),
            "How single sensors differ from their drawing, as `slamd calibrate` finds it.",
        ),
    ]
}

fn circle() -> Vec<Key> {
    vec![
        required(whole("count", 1, i64::from(MAX_SENSORS), "How many sensors.")),
        required(number("radius_m", 0.0, 2.0, "Radius of the circle, metres.")),
        required(number("half_angle_deg", 0.0, 60.0, "Half the beam's opening angle, degrees; 0 for a laser.")),
        Key {
            at_most: Some("count"),
            ..whole(
                "groups",
                1,
                i64::from(MAX_SENSORS),
                "How many firing groups, interleaved round the ring; 1 where absent.",
            )
        },
        key(
            "clockwise",
            Shape::Flag,
            "True where the sensors are numbered clockwise from straight ahead; false where absent.",
        ),
    ]
}

fn sensor() -> Vec<Key> {
    vec![
        number("x_m", -2.0, 2.0, "Metres ahead of the middle between the wheels; 0 where absent."),
        number("y_m", -2.0, 2.0, "Metres to the left of the middle between the wheels; 0 where absent."),
        required(number(
            "bearing_deg",
            -360.0,
            360.0,
            "Direction of the beam, degrees counter-clockwise from straight ahead.",
        )),
        required(number("half_angle_deg", 0.0, 60.0, "Half the beam's opening angle, degrees; 0 for a laser.")),
        whole("group", 0, 255, "Firing group; 0 where absent."),
    ]
}

fn correction() -> Vec<Key> {
    vec![
        required(whole("sensor", 0, i64::from(MAX_SENSORS) - 1, "The sensor's id.")),
        number("range_bias_m", -0.5, 0.5, "How much too long it reads, metres; 0 where absent."),
        number(
            "bearing_offset_deg",
            -45.0,
            45.0,
            "How far it is turned counter-clockwise from its drawing, degrees; 0 where absent.",
        ),
    ]
}

fn map() -> Vec<Key> {
    vec![number("cell_m", 0.01, 0.5, "Side of a cell, metres; the paper's method always uses 0.01.")]
}

/// The board's settings; the protocol has their names and ranges.
fn board() -> Vec<Key> {
    Setting::ALL
        .into_iter()
        .map(|setting| match setting.range().into_inner() {
            (0, 1) => key(setting.name(), Shape::Switch, about(setting)),
            (least, most) => whole(setting.name(), least.into(), most.into(), about(setting)),
        })
        .collect()
}

const fn about(setting: Setting) -> &'static str {
    match setting {
        Setting::Sensors => "Sensors of the ring.",
        Setting::Groups => "Firing groups; sensor i belongs to group i mod groups.",
        Setting::SlotUs => "From one group's trigger to the next, microseconds.",
        Setting::EncoderPeriodMs => "How often the encoders are told, milliseconds.",
        Setting::TicksPerTurn => "Encoder ticks per turn of a wheel: all edges of both channels.",
        Setting::LeftReversed => "True where the left encoder counts backwards.",
        Setting::RightReversed => "True where the right encoder counts backwards.",
        Setting::WheelsSwapped => "True where the encoders are on each other's pins.",
        Setting::RingRadiusMm => "Radius of the circle on which the sensors sit, millimetres.",
        Setting::HalfAngleCdeg => "Half the beam's opening angle, hundredths of degrees.",
        Setting::Clockwise => "True where the sensors are numbered clockwise.",
        Setting::MaxRangeMm => "What is farther is no echo, millimetres.",
    }
}

const fn key(name: &'static str, shape: Shape, about: &'static str) -> Key {
    Key { name, about, shape, is_required: false, at_most: None, instead_of: None }
}

const fn number(name: &'static str, least: f64, most: f64, about: &'static str) -> Key {
    key(name, Shape::Number(least, most), about)
}

const fn whole(name: &'static str, least: i64, most: i64, about: &'static str) -> Key {
    key(name, Shape::Whole(least, most), about)
}

fn required(key: Key) -> Key {
    Key { is_required: true, ..key }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn the_table_and_the_types_have_the_same_keys() {
        fn compare(path: &str, keys: &[Key], table: &toml::Table) {
            for name in table.keys() {
                assert!(keys.iter().any(|key| key.name == name), "{path}.{name} is in no table");
            }
            for key in keys {
                if let (Shape::Table(keys), Some(toml::Value::Table(table))) = (&key.shape, table.get(key.name)) {
                    compare(key.name, keys, table);
                }
            }
        }
        compare("", &keys(), &toml::Table::try_from(Config::default()).unwrap());
        // The types know the keys without a default, too.
        let text = "[robot]\nwheel_base_sigma_m = 0.1\nticks_per_turn = 9\n[ring.circle]\ncount = 2\nradius_m = 1\nhalf_angle_deg = 3\ngroups = 2\nclockwise = true\n\
            [[ring.corrections]]\nsensor = 2\nrange_bias_m = 0.1\nbearing_offset_deg = 3\n[board]\nclockwise = 1\nslot_us = 20000\n";
        assert!(Config::from_toml(text).is_ok(), "{:?}", Config::from_toml(text));
        let text = "[[ring.sensors]]\nx_m = 1\ny_m = 1\nbearing_deg = 3\nhalf_angle_deg = 3\ngroup = 3\n";
        assert!(Config::from_toml(text).is_ok(), "{:?}", Config::from_toml(text));
    }

    #[test]
    fn defaults_are_in_their_ranges() {
        let table = toml::Value::Table(toml::Table::try_from(Config::default()).unwrap());
        for (path, key) in values() {
            let default = path.split('.').try_fold(&table, |table, name| table.get(name));
            let refusal = default.and_then(|default| key.shape.refusal(&path, default));
            assert_eq!(refusal, None);
        }
    }
}
