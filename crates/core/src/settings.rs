//! Brings the board's settings in line with the robot's configuration: gets each value, sets what differs, gets it again.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use slamd_protocol::{AckResult, Message, Setting, kind};

/// The board's settings that the configuration names.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings {
    wanted: Vec<Wanted>,
}

#[derive(Clone, Copy, Debug)]
struct Wanted {
    setting: Setting,
    value: i32,
    next: Step,
    asked: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Get,
    Stop,
    Set,
    Done,
}

/// Unanswered questions before a setting is given up.
const MAX_ASKED: u8 = 20;

impl Settings {
    /// The wanted settings; without any, no question is asked.
    #[must_use]
    pub(crate) fn new(wanted: impl IntoIterator<Item = (Setting, i32)>) -> Self {
        let wanted = wanted.into_iter().map(|(setting, value)| Wanted { setting, value, next: Step::Get, asked: 0 });
        Self { wanted: wanted.collect() }
    }

    /// The board restarted or may be another one: asks for all values again.
    pub(crate) fn restart(&mut self) {
        for wanted in &mut self.wanted {
            (wanted.next, wanted.asked) = (Step::Get, 0);
        }
    }

    /// The next message to the board; none once all values are as wanted.
    #[must_use]
    pub(crate) fn question(&self) -> Option<Message> {
        let wanted = self.wanted.iter().find(|wanted| wanted.next != Step::Done)?;
        let key = wanted.setting.key();
        Some(match wanted.next {
            Step::Get | Step::Done => Message::ConfigGet { key },
            Step::Stop => Message::Stop,
            Step::Set => Message::ConfigSet { key, value: wanted.value },
        })
    }

    /// The question was sent once more. Returns an error text after too many questions without an answer.
    pub(crate) fn asked(&mut self) -> Option<String> {
        let wanted = self.current()?;
        wanted.asked += 1;
        (wanted.asked > MAX_ASKED).then(|| {
            wanted.next = Step::Done;
            format!("the board does not answer for board.{}: update its firmware", wanted.setting.name())
        })
    }

    /// A value arrived.
    pub(crate) fn told(&mut self, key: u8, value: i32) {
        if let Some(wanted) = self.current()
            && wanted.setting.key() == key
            && wanted.next == Step::Get
        {
            wanted.next = if value == wanted.value { Step::Done } else { Step::Set };
        }
    }

    /// The result of a command arrived. Returns an error text if the board does not accept the setting.
    pub(crate) fn acknowledged(&mut self, of_type: u8, result: AckResult) -> Option<String> {
        let wanted = self.current()?;
        let name = wanted.setting.name();
        match (wanted.next, of_type, result) {
            (Step::Set, kind::CONFIG_SET, AckResult::Done) => wanted.next = Step::Get,
            (Step::Set, kind::CONFIG_SET, AckResult::Busy) => wanted.next = Step::Stop,
            (Step::Stop, kind::STOP, AckResult::Done) => wanted.next = Step::Set,
            (Step::Set, kind::CONFIG_SET, AckResult::Refused) => {
                wanted.next = Step::Done;
                return Some(format!(
                    "the board refuses board.{name} = {}: it goes on with its own value",
                    wanted.value
                ));
            }
            (Step::Get | Step::Set, kind::CONFIG_GET | kind::CONFIG_SET, AckResult::Unknown) => {
                wanted.next = Step::Done;
                return Some(format!(
                    "the board does not know board.{name}: update its firmware, or leave the key away"
                ));
            }
            _ => {}
        }
        None
    }

    fn current(&mut self) -> Option<&mut Wanted> {
        self.wanted.iter_mut().find(|wanted| wanted.next != Step::Done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings::new([(Setting::SlotUs, 30_000)])
    }

    #[test]
    fn what_is_as_wanted_is_left_alone() {
        let mut settings = settings();
        assert_eq!(settings.question(), Some(Message::ConfigGet { key: Setting::SlotUs.key() }));
        settings.told(Setting::SlotUs.key(), 30_000);
        assert_eq!(settings.question(), None);
        settings.restart();
        assert!(settings.question().is_some());
    }

    #[test]
    fn what_differs_is_set_and_looked_at_again_even_while_the_ring_fires() {
        let mut settings = settings();
        settings.told(Setting::SlotUs.key(), 25_000);
        let set = Some(Message::ConfigSet { key: Setting::SlotUs.key(), value: 30_000 });
        assert_eq!(settings.question(), set);
        assert_eq!(settings.acknowledged(kind::CONFIG_SET, AckResult::Busy), None);
        assert_eq!(settings.question(), Some(Message::Stop));
        assert_eq!(settings.acknowledged(kind::STOP, AckResult::Done), None);
        assert_eq!(settings.question(), set);
        assert_eq!(settings.acknowledged(kind::CONFIG_SET, AckResult::Done), None);
        assert_eq!(settings.question(), Some(Message::ConfigGet { key: Setting::SlotUs.key() }));
        settings.told(Setting::SlotUs.key(), 30_000);
        assert_eq!(settings.question(), None);
    }

    #[test]
    fn a_refusal_and_silence_are_told_once() {
        let mut refused = settings();
        refused.told(Setting::SlotUs.key(), 25_000);
        let words = refused.acknowledged(kind::CONFIG_SET, AckResult::Refused).unwrap();
        assert!(words.contains("board.slot_us = 30000"), "{words}");
        assert_eq!(refused.question(), None);
        let mut silent = settings();
        let words: Vec<String> = (0..100).filter_map(|_| silent.asked()).collect();
        assert_eq!(words.len(), 1);
        assert!(words[0].contains("update its firmware"), "{words:?}");
    }
}
