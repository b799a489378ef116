//! What makes the pose doubtful although the echoes may agree with the map: told when it begins and when all of it is over.

use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::time::Timestamp;

/// A reason to doubt the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Doubt {
    /// The filter itself knows the position too badly.
    Vague,
    /// The walls move the pose by more than the wheels' errors allow.
    Dragged,
    /// More than a third of the ring looks faulty at once.
    RingSuspect,
}

/// The reasons that hold, and what was told.
#[derive(Debug, Default)]
pub(super) struct Doubts {
    holds: [bool; 3],
    /// The first instant of the doubt that was told.
    told: Option<Timestamp>,
}

impl Doubt {
    const ALL: [Self; 3] = [Self::Vague, Self::Dragged, Self::RingSuspect];

    const fn reason(self) -> &'static str {
        match self {
            Self::Vague => "no wall has corrected the position for long: it is known to no better than 0.3 m",
            Self::Dragged => {
                "the walls move the pose by more than the wheels' errors allow: it follows the wheels from where they last agreed"
            }
            Self::RingSuspect => {
                "more than a third of the sensors look faulty at once: the pose, the map or the noise of the readings is wrong rather than they"
            }
        }
    }
}

impl Doubts {
    pub(super) fn set(&mut self, doubt: Doubt, holds: bool) {
        self.holds[doubt as usize] = holds;
    }

    pub(super) fn holds(&self, doubt: Doubt) -> bool {
        self.holds[doubt as usize]
    }

    /// Tells what has changed. The events after `older` are of this sweep: what ends another doubt in them does not end this one.
    pub(super) fn tell(&mut self, at: Timestamp, older: usize, events: &mut Vec<Event>) {
        let doubt = Doubt::ALL.into_iter().find(|&doubt| self.holds(doubt));
        let ends_another = |event: &Event| matches!(event, Event::Localization(change) if !change.is_lost());
        let change = match (doubt, self.told) {
            (Some(doubt), told) if told.is_none() || events.iter().skip(older).any(ends_another) => {
                self.told = told.or(Some(at));
                LocalizationChange::Doubted { reason: doubt.reason().into() }
            }
            (None, Some(_)) => LocalizationChange::Trusted,
            _ => return,
        };
        let since = self.told.unwrap_or(at);
        if change == LocalizationChange::Trusted {
            self.told = None;
        }
        events.push(Event::Localization(LocalizationEvent { at, since, change }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doubt_is_told_once_and_again_when_another_ends_before_it() {
        let (mut doubts, at) = (Doubts::default(), Timestamp::from_us(7));
        let told = |doubts: &mut Doubts, mut events: Vec<Event>| {
            let before = events.len();
            doubts.tell(at, 0, &mut events);
            events.split_off(before)
        };
        assert_eq!(told(&mut doubts, vec![]), []);
        doubts.set(Doubt::Dragged, true);
        assert!(matches!(&told(&mut doubts, vec![])[..], [Event::Localization(event)] if event.is_lost()));
        doubts.set(Doubt::Vague, true);
        assert_eq!(told(&mut doubts, vec![]), []);
        let change = LocalizationChange::Regained { moved_m: 0.0, turned_rad: 0.0 };
        let regained = Event::Localization(LocalizationEvent { at, since: at, change });
        assert!(matches!(&told(&mut doubts, vec![regained])[..], [Event::Localization(event)] if event.is_lost()));
        doubts.set(Doubt::Dragged, false);
        assert_eq!(told(&mut doubts, vec![]), []);
        doubts.set(Doubt::Vague, false);
        let trusted = LocalizationEvent { at, since: at, change: LocalizationChange::Trusted };
        assert_eq!(told(&mut doubts, vec![]), [Event::Localization(trusted)]);
    }
}
