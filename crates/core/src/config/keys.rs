//! All keys of the configuration: for the check, the schema and the environment variables.
//!
//! The defaults are in the types, not here.

use super::calibration::SIGMA_FLOOR;
use super::shape::Shape;
use slamd_protocol::Setting;

/// [`slamd_protocol::MAX_SENSORS`] as the type of sensor ids.
pub(super) const MAX_SENSORS: u8 = 64;
const _: () = assert!(MAX_SENSORS as usize == slamd_protocol::MAX_SENSORS);

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
        key("method", Shape::Choice(&["walls", "paper"]), "Estimation method for heading, position and map."),
        key("robot", Shape::Table(robot()), "The robot and its wheels."),
        key(
            "ring",
            Shape::Table(ring()),
            "The sensors. Without `sensors` and `circle` the board reports where they are mounted.",
        ),
        key("map", Shape::Table(map()), "The map."),
        key("drive", Shape::Table(drive()), "Limits of what slamd commands to the motors, with --drive."),
        key(
            "board",
            Shape::Table(board()),
            "Settings that slamd writes to the board if they differ; the board keeps its own values of the others.",
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
            "Standard deviation of wheel_base_m, metres; default 2.5 % of it.",
        ),
        number(
            "wheel_ratio",
            0.5,
            2.0,
            "Radius of the right wheel divided by the radius of the left; wheel_radius_m is their mean.",
        ),
        number("wheel_ratio_sigma", SIGMA_FLOOR, 0.2, "Standard deviation of wheel_ratio."),
        whole("ticks_per_turn", 1, 10_000_000, "Encoder ticks per wheel turn; default the board's own value."),
        number("max_speed_m_s", 0.01, 10.0, "Highest speed of the robot, metres per second."),
        number("max_turn_rate_rad_s", 0.01, 30.0, "Highest turn rate of the robot, radians per second."),
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
                "Shortest distance that a sensor measures, metres; a shorter one is \"too close\".",
            )
        },
        number(
            "max_range_m",
            0.1,
            20.0,
            "Longest distance that a sensor measures, metres; a longer one is \"nothing in range\".",
        ),
        number(
            "range_sigma_m",
            0.002,
            0.15,
            "Standard deviation of a reading, metres; default 0.02. slamd learns it if the readings scatter more.",
        ),
        number(
            "range_scale",
            0.02,
            50.0,
            "True over reported range: 2 for a board that reports the time of flight one way, 10 for millimetres that are taken for centimetres.",
        ),
        number("temperature_c", -40.0, 85.0, "Air temperature until the board reports one, degrees Celsius."),
        key(
            "circle",
            Shape::Table(circle()),
            "Sensors evenly spaced on a circle, facing outward, instead of the board's geometry.",
        ),
        Key {
            instead_of: Some("circle"),
            ..key("sensors", Shape::List(sensor(), MAX_SENSORS), "Sensors one by one, instead of the board's geometry.")
        },
        number(
            "rotation_deg",
            -360.0,
            360.0,
            "Rotation of the whole ring against `circle`, `sensors` or the board's geometry, degrees counter-clockwise.",
        ),
        key(
            "mirrored",
            Shape::Flag,
            "True if left and right of that geometry are exchanged: the sensors are numbered the other way round.",
        ),
        key(
            "corrections",
            Shape::List(correction(), MAX_SENSORS),
            "Corrections of single sensors, as written by `slamd calibrate`.",
        ),
    ]
}

fn circle() -> Vec<Key> {
    vec![
        required(whole("count", 1, i64::from(MAX_SENSORS), "Number of sensors.")),
        required(number("radius_m", 0.0, 2.0, "Radius of the circle, metres.")),
        required(number("half_angle_deg", 0.0, 60.0, "Half the beam's opening angle, degrees; 0 for a laser.")),
        Key {
            at_most: Some("count"),
            ..whole(
                "groups",
                1,
                i64::from(MAX_SENSORS),
                "Number of firing groups, interleaved around the ring; default 1.",
            )
        },
        key("clockwise", Shape::Flag, "True if the sensors are numbered clockwise from straight ahead; default false."),
    ]
}

fn sensor() -> Vec<Key> {
    vec![
        number("x_m", -2.0, 2.0, "Position ahead of the midpoint between the wheels, metres; default 0."),
        number("y_m", -2.0, 2.0, "Position left of the midpoint between the wheels, metres; default 0."),
        required(number(
            "bearing_deg",
            -360.0,
            360.0,
            "Direction of the beam, degrees counter-clockwise from straight ahead.",
        )),
        required(number("half_angle_deg", 0.0, 60.0, "Half the beam's opening angle, degrees; 0 for a laser.")),
        whole("group", 0, 255, "Firing group; default 0."),
    ]
}

fn correction() -> Vec<Key> {
    vec![
        required(whole("sensor", 0, i64::from(MAX_SENSORS) - 1, "The sensor's id.")),
        number("range_bias_m", -0.5, 0.5, "Range bias, metres, positive if the sensor reads too long; default 0."),
        number(
            "bearing_offset_deg",
            -45.0,
            45.0,
            "Bearing offset from the nominal direction, degrees counter-clockwise; default 0.",
        ),
    ]
}

fn map() -> Vec<Key> {
    vec![number("cell_m", 0.01, 0.5, "Side length of a cell, metres; the paper's method always uses 0.01.")]
}

fn drive() -> Vec<Key> {
    vec![
        number("max_speed_m_s", 0.01, 2.0, "Highest speed forward or backward, metres per second."),
        number("max_turn_rad_s", 0.01, 10.0, "Highest turn rate, radians per second."),
        number(
            "acceleration_m_s2",
            0.02,
            5.0,
            "Ramp of the speed, metres per second squared; stops do not wait for it.",
        ),
        number("turn_acceleration_rad_s2", 0.1, 50.0, "Ramp of the turn rate, radians per second squared."),
        number(
            "lease_s",
            0.5,
            60.0,
            "So long after its last command a client remains the only one that may drive, seconds.",
        ),
    ]
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
        Setting::Sensors => "Number of sensors.",
        Setting::Groups => "Firing groups; sensor i belongs to group i mod groups.",
        Setting::SlotUs => "Time between the triggers of two groups, microseconds.",
        Setting::EncoderPeriodMs => "Period of the encoder messages, milliseconds.",
        Setting::TicksPerTurn => "Encoder ticks per wheel turn, counting all edges of both channels.",
        Setting::LeftReversed => "True if the left encoder counts backwards.",
        Setting::RightReversed => "True if the right encoder counts backwards.",
        Setting::WheelsSwapped => "True if the left and right encoders are swapped.",
        Setting::RingRadiusMm => "Radius of the circle of sensors, millimetres.",
        Setting::HalfAngleCdeg => "Half the beam's opening angle, hundredths of degrees.",
        Setting::Clockwise => "True if the sensors are numbered clockwise.",
        Setting::MaxRangeMm => "Longest range, millimetres; a farther echo is reported as no echo.",
        Setting::TopSpeedMmS => "Highest speed of a driven wheel, mm/s; 0 for a board without motors.",
        Setting::AccelerationMmS2 => "Ramp of the driven wheels, mm/s²; stops do not wait for it.",
        Setting::StopDistanceMm => "The board stops before an echo nearer than this, millimetres from the sensor.",
        Setting::WheelRadiusUm => "Radius of a driven wheel, micrometres.",
        Setting::GainForward => "Motor control: thousandths of full voltage per 100 mm/s of commanded speed.",
        Setting::GainProportional => "Motor control: thousandths of full voltage per 100 mm/s of error.",
        Setting::GainIntegral => "Motor control: thousandths of full voltage per 100 mm/s of error, each second.",
        Setting::LeftMotorReversed => "True if the left motor runs backwards.",
        Setting::RightMotorReversed => "True if the right motor runs backwards.",
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
