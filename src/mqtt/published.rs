//! The retained messages that the broker holds, so that only changes are published.

use bytes::Bytes;
use std::collections::BTreeMap;

/// The payload last published, by topic.
#[derive(Debug, Default)]
pub(super) struct Published {
    payloads: BTreeMap<String, Bytes>,
    /// Messages that found the client's queue full. The next snapshot publishes newer ones.
    pub(super) dropped: u64,
}

impl Published {
    /// Passes `payload` to `publish` if the topic does not hold it yet, and stores it if `publish` accepts it.
    pub(super) fn update(&mut self, topic: String, payload: Bytes, publish: impl FnOnce(&str, Bytes) -> bool) {
        if self.payloads.get(&topic).is_some_and(|last| *last == payload) {
            return;
        }
        if publish(&topic, payload.clone()) {
            self.payloads.insert(topic, payload);
        } else {
            self.dropped += 1;
        }
    }

    /// Publishes everything again after a new connection: the broker may have lost its retained messages.
    pub(super) fn clear(&mut self) {
        self.payloads.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changed_and_rejected_payloads_are_published_again() {
        let mut published = Published::default();
        let mut sent = Vec::new();
        let mut update = |published: &mut Published, payload: &'static str, has_room: bool| {
            published.update("link".into(), payload.into(), |_, payload| {
                sent.extend(has_room.then_some(payload));
                has_room
            });
        };
        update(&mut published, "stale", true);
        update(&mut published, "stale", true);
        update(&mut published, "lost", false);
        update(&mut published, "lost", true);
        published.clear();
        update(&mut published, "lost", true);
        assert_eq!(sent, ["stale", "lost", "lost"]);
        assert_eq!(published.dropped, 1);
    }
}
