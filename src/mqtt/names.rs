//! Topics and ids of one robot.

/// Topics and ids of a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// The robot's name for display.
    pub title: String,
    robot: String,
}

/// Longest robot id, characters; a longer name is cut.
const MAX_LENGTH: usize = 64;

impl Names {
    /// Names for a robot. Its id is in lower case, with `_` for all other characters than letters and digits, as Home Assistant requires.
    #[must_use]
    pub fn new(robot: &str) -> Self {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
        let id: String = robot.chars().map(plain).take(MAX_LENGTH).collect();
        let id = id.trim_matches('_');
        Self { title: robot.into(), robot: if id.is_empty() { "robot".into() } else { id.into() } }
    }

    /// The device's id, unique in Home Assistant.
    #[must_use]
    pub fn device(&self) -> String {
        format!("slamd_{}", self.robot)
    }

    /// A topic of the robot, such as `slamd/robot/pose`.
    #[must_use]
    pub fn topic(&self, what: &str) -> String {
        format!("slamd/{}/{what}", self.robot)
    }

    /// The discovery topic of an entity.
    #[must_use]
    pub fn config_topic(&self, component: &str, entity: &str) -> String {
        format!("homeassistant/{component}/{}/{entity}/config", self.device())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_valid_for_home_assistant() {
        let topic = |robot: &str| Names::new(robot).topic("pose");
        assert_eq!(topic("robot"), "slamd/robot/pose");
        assert_eq!(topic("Erna's #1/+"), "slamd/erna_s__1/pose");
        assert_eq!(topic("空"), "slamd/robot/pose");
        assert_eq!(Names::new("Küche").config_topic("sensor", "x"), "homeassistant/sensor/slamd_k_che/x/config");
    }
}
