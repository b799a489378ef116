//! The robot as URDF, for `/robot_description`: a disc with its sensors.

use super::message::{BASE, sonar};
use slamd_core::Ring;
use std::fmt::Write as _;

/// Height of the disc, and radius of a sensor, metres: for the eye.
const HEIGHT_M: f64 = 0.1;
const SENSOR_M: f64 = 0.015;

/// The URDF of a robot of this name.
pub(super) fn urdf(name: &str, ring: &Ring, wheel_base_m: f64) -> String {
    let radius_m = ring
        .mountings
        .iter()
        .map(|mounting| mounting.robot_from_sensor.position().coords.norm())
        .fold(0.5 * wheel_base_m, f64::max);
    let name: String = name.chars().filter(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | ' ')).collect();
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{name}\">\n  <link name=\"{BASE}\"><visual><geometry><cylinder radius=\"{radius_m:.3}\" length=\"{HEIGHT_M}\"/></geometry></visual></link>\n"
    );
    for (sensor, mounting) in ring.mountings.iter().enumerate() {
        let (frame, pose) = (sonar(sensor), mounting.robot_from_sensor);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "  <link name=\"{frame}\"><visual><geometry><sphere radius=\"{SENSOR_M}\"/></geometry></visual></link>\n  \
             <joint name=\"{frame}_joint\" type=\"fixed\"><parent link=\"{BASE}\"/><child link=\"{frame}\"/><origin xyz=\"{:.4} {:.4} 0\" rpy=\"0 0 {:.5}\"/></joint>",
            pose.x_m, pose.y_m, pose.theta_rad
        );
    }
    text + "</robot>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sensor_has_a_link_and_a_joint() {
        let text = urdf("a <robot>", &Ring::circle(8, 0.15, 0.2, 1), 0.26);
        assert_eq!((text.matches("<link ").count(), text.matches("<joint ").count()), (9, 8));
        assert!(text.contains("<robot name=\"a robot\">") && text.ends_with("</robot>\n"), "{text}");
    }
}
