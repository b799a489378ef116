//! What the broker has been told on this connection: only what is new is told again.

use bytes::Bytes;
use std::collections::BTreeMap;

/// The payload last told, by topic.
#[derive(Debug, Default)]
pub(super) struct Bulletin {
    told: BTreeMap<String, Bytes>,
    /// Messages for which there was no room. They are not lost: the next snapshot has newer ones.
    pub(super) dropped: u64,
}

impl Bulletin {
    /// Hands `payload` to `tell` where the broker does not know it yet, and remembers it where that had room.
    pub(super) fn tell(&mut self, topic: String, payload: Bytes, tell: impl FnOnce(&str, Bytes) -> bool) {
        if self.told.get(&topic).is_some_and(|told| *told == payload) {
            return;
        }
        if tell(&topic, payload.clone()) {
            self.told.insert(topic, payload);
        } else {
            self.dropped += 1;
        }
    }

    /// Another broker, or one that has forgotten: everything is new to it.
    pub(super) fn forget(&mut self) {
        self.told.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_not_told_again_and_what_had_no_room_is() {
        let mut bulletin = Bulletin::default();
        let mut told = Vec::new();
        let mut tell = |bulletin: &mut Bulletin, payload: &'static str, has_room: bool| {
            bulletin.tell("link".into(), payload.into(), |_, payload| {
                told.extend(has_room.then_some(payload));
                has_room
            });
        };
        tell(&mut bulletin, "stale", true);
        tell(&mut bulletin, "stale", true);
        tell(&mut bulletin, "lost", false);
        tell(&mut bulletin, "lost", true);
        bulletin.forget();
        tell(&mut bulletin, "lost", true);
        assert_eq!(told, ["stale", "lost", "lost"]);
        assert_eq!(bulletin.dropped, 1);
    }
}
