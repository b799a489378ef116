//! Names of sites and robots, and the keys made of them.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The name of a site or a robot: 1 to 32 of `a-z`, `0-9`, `-` and `_`. So it is part of a key, a folder's name and a user's name as it is.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Name(String);

const LONGEST: usize = 32;

/// What a robot publishes and answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Put: the pose at each sweep.
    Pose,
    /// Put: the ranges of each sweep.
    Sweep,
    /// Put once a second: what there is to be asked for.
    Status,
    /// Query: the newest map.
    Map,
    /// Query: a piece of a capture.
    Capture,
    /// The liveliness token.
    Alive,
}

impl Topic {
    /// The last part of the key.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Sweep => "sweep",
            Self::Status => "status",
            Self::Map => "map",
            Self::Capture => "capture",
            Self::Alive => "alive",
        }
    }
}

/// `slamd/<site>/<robot>/<topic>`.
#[must_use]
pub fn key(site: &Name, robot: &Name, topic: Topic) -> String {
    format!("slamd/{site}/{robot}/{}", topic.word())
}

/// All that a robot may write.
#[must_use]
pub fn below(site: &Name, robot: &Name) -> String {
    format!("slamd/{site}/{robot}/**")
}

impl FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_good = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-' || byte == b'_';
        if (1..=LONGEST).contains(&text.len()) && text.bytes().all(is_good) {
            Ok(Self(text.into()))
        } else {
            Err(format!("a name has 1 to {LONGEST} characters, of a-z, 0-9, - and _"))
        }
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Name> for String {
    fn from(name: Name) -> Self {
        name.0
    }
}

impl AsRef<str> for Name {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_leave_its_place() {
        for bad in ["", "Kitchen", "a/b", "..", "*", "a b", "a\n", "köln", &"x".repeat(33)] {
            assert!(bad.parse::<Name>().is_err(), "{bad:?}");
        }
        let [site, robot] = ["home", "robot-2_b"].map(|name| name.parse().unwrap());
        assert_eq!(key(&site, &robot, Topic::Map), "slamd/home/robot-2_b/map");
    }
}
