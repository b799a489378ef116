//! Topics and ids of one robot.

/// The names under which a robot is published.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// The robot's name as people read it.
    pub title: String,
    robot: String,
}

/// A longer name is cut.
const LONGEST: usize = 64;

impl Names {
    /// For a robot of this name: lower case, and `_` for whatever is neither letter nor digit, as Home Assistant wants its ids.
    #[must_use]
    pub fn new(robot: &str) -> Self {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
        let id: String = robot.chars().map(plain).take(LONGEST).collect();
        let id = id.trim_matches('_');
        Self { title: robot.into(), robot: if id.is_empty() { "robot".into() } else { id.into() } }
    }

    /// Unique among all that is in Home Assistant.
    #[must_use]
    pub fn device(&self) -> String {
        format!("slamd_{}", self.robot)
    }

    /// Where something of the robot is published, such as `slamd/robot/pose`.
    #[must_use]
    pub fn topic(&self, what: &str) -> String {
        format!("slamd/{}/{what}", self.robot)
    }

    /// Where Home Assistant looks for an entity's description.
    #[must_use]
    pub fn config_topic(&self, component: &str, entity: &str) -> String {
        format!("homeassistant/{component}/{}/{entity}/config", self.device())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_what_home_assistant_takes() {
        let topic = |robot: &str| Names::new(robot).topic("pose");
        assert_eq!(topic("robot"), "slamd/robot/pose");
        assert_eq!(topic("Erna's #1/+"), "slamd/erna_s__1/pose");
        assert_eq!(topic("空"), "slamd/robot/pose");
        assert_eq!(Names::new("Küche").config_topic("sensor", "x"), "homeassistant/sensor/slamd_k_che/x/config");
    }
}
