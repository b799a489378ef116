//! What the check of the robot found, written into the configuration.

use super::Drive;
use slamd_core::{Config, ModelFinding, ModelState};

/// The configuration with the first remedy of each finding about wheels, ranges and ring that the drive was corrected by; none if there
/// is no such finding, or one whose remedy is not sure.
pub(super) fn mended(config: &Config, drive: &Drive) -> Option<Config> {
    let mut mended = config.clone();
    drive.findings.first()?;
    for event in &drive.findings {
        if event.state != ModelState::Corrected || !apply(&mut mended, &event.finding) {
            return None;
        }
    }
    Some(mended)
}

/// Sets the first remedy's key. False if the key is none of the robot's measures.
fn apply(config: &mut Config, finding: &ModelFinding) -> bool {
    let Some((key, value)) = finding.remedies.first() else { return false };
    let Ok(number) = value.parse::<f64>() else { return false };
    match *key {
        "robot.ticks_per_turn" => {
            let Ok(ticks) = value.parse() else { return false };
            config.robot.ticks_per_turn = Some(ticks);
        }
        "robot.wheel_radius_m" => config.robot.wheel_radius_m = number,
        "robot.wheel_base_m" => config.robot.wheel_base_m = number,
        "ring.rotation_deg" => config.ring.rotation_deg = number,
        "ring.range_scale" => config.ring.range_scale = number,
        _ => return false,
    }
    Config::from_toml(&config.to_toml()).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{ModelAspect, ModelEvent, Timestamp};

    fn drive(state: ModelState, key: &'static str, value: &str) -> Drive {
        let finding = ModelFinding {
            aspect: ModelAspect::WheelScale,
            measured: 4.0,
            sigma: 0.1,
            clause: String::new(),
            remedies: vec![(key, value.into())],
        };
        let at = Timestamp::default();
        Drive { findings: vec![ModelEvent { at, since: at, finding, state }], ..Drive::default() }
    }

    #[test]
    fn a_sure_remedy_is_written_and_another_is_not() {
        let config = Config::default();
        let ticks = mended(&config, &drive(ModelState::Corrected, "robot.ticks_per_turn", "5760")).unwrap();
        assert_eq!(ticks.robot.ticks_per_turn, Some(5760));
        assert_eq!(mended(&config, &drive(ModelState::Doubted, "robot.ticks_per_turn", "5760")), None);
        assert_eq!(mended(&config, &drive(ModelState::Corrected, "robot.wheel_radius_m", "0")), None);
        assert_eq!(mended(&config, &drive(ModelState::Corrected, "board.wheels_swapped", "true")), None);
        assert_eq!(mended(&config, &Drive::default()), None);
    }
}
