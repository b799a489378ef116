//! Keys held in a terminal become a velocity. Terminals tell of presses and repeats, few of releases: a key is held until its repeats stop.
//!
//! Presses and times go in, velocities come out; no terminal and no clock.

use super::order::Twist;
use slamd_core::Timestamp;
use std::time::Duration;

/// A keyboard repeats a held key only after a while, then quickly. A key that is pressed once is held for the first time, a key that repeats
/// until it has not for the second. X repeats after 660 ms, the Linux console after 250 ms.
const FIRST: Duration = Duration::from_millis(700);
const REPEAT: Duration = Duration::from_millis(200);

/// What a key means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Forward.
    Ahead,
    /// Backward.
    Back,
    /// Turn counter-clockwise.
    Left,
    /// Turn clockwise.
    Right,
    /// Stop now.
    Stop,
}

/// The key that is held.
#[derive(Clone, Copy, Debug, Default)]
pub struct Keys {
    held: Option<(Key, Timestamp)>,
}

impl Keys {
    /// A key was pressed, or its repeat came.
    pub fn pressed(&mut self, key: Key, at: Timestamp) {
        let repeats = self.held(at) == Some(key);
        self.held = (key != Key::Stop).then(|| (key, at + if repeats { REPEAT } else { FIRST }));
    }

    /// A key was released, where the terminal tells.
    pub fn released(&mut self, key: Key) {
        self.held.take_if(|(held, _)| *held == key);
    }

    /// What the held key commands at full speed `full`; none where no key is held.
    #[must_use]
    pub fn twist(&self, full: Twist, at: Timestamp) -> Option<Twist> {
        let forward = |share: f64| Twist { forward_m_s: share * full.forward_m_s, turn_rad_s: 0.0 };
        let turn = |share: f64| Twist { forward_m_s: 0.0, turn_rad_s: share * full.turn_rad_s };
        match self.held(at)? {
            Key::Ahead => Some(forward(1.0)),
            Key::Back => Some(forward(-1.0)),
            Key::Left => Some(turn(1.0)),
            Key::Right => Some(turn(-1.0)),
            Key::Stop => None,
        }
    }

    fn held(&self, at: Timestamp) -> Option<Key> {
        self.held.filter(|(_, until)| at < *until).map(|(key, _)| key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: Twist = Twist { forward_m_s: 0.2, turn_rad_s: 1.0 };

    fn ms(ms: u64) -> Timestamp {
        Timestamp::from_us(1_000 * ms)
    }

    #[test]
    fn a_key_is_held_over_the_first_pause_and_until_its_repeats_stop() {
        let mut keys = Keys::default();
        assert_eq!(keys.twist(FULL, ms(0)), None);
        keys.pressed(Key::Ahead, ms(0));
        assert_eq!(keys.twist(FULL, ms(650)), Some(Twist { forward_m_s: 0.2, turn_rad_s: 0.0 }));
        for at in (660..2_000).step_by(40) {
            keys.pressed(Key::Ahead, ms(at));
        }
        assert!(keys.twist(FULL, ms(2_100)).is_some());
        assert_eq!(keys.twist(FULL, ms(2_190)), None, "the last repeat was at 1980 ms");
    }

    #[test]
    fn a_release_a_stop_and_another_key_end_it_at_once() {
        let mut keys = Keys::default();
        keys.pressed(Key::Left, ms(0));
        keys.released(Key::Right);
        assert_eq!(keys.twist(FULL, ms(1)), Some(Twist { forward_m_s: 0.0, turn_rad_s: 1.0 }));
        keys.pressed(Key::Back, ms(10));
        assert_eq!(keys.twist(FULL, ms(11)), Some(Twist { forward_m_s: -0.2, turn_rad_s: 0.0 }));
        keys.released(Key::Back);
        assert_eq!(keys.twist(FULL, ms(12)), None);
        keys.pressed(Key::Right, ms(20));
        keys.pressed(Key::Stop, ms(21));
        assert_eq!(keys.twist(FULL, ms(22)), None);
    }
}
