//! The host's side of the conversation with the board: its identity, its settings, and whether it restarted.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::board::Board;
use crate::config::Config;
use crate::event::Event;
use crate::geometry::Ring;
use crate::handshake::{Handshake, Known};
use crate::settings::Settings;
use crate::time::Timestamp;
use slamd_protocol::{AckResult, Geometry, Hello, Message};
use std::time::Duration;

/// Without a sensor group for this long the board may have restarted. Doubt that lasts this long counts as a restart.
const SILENCE: Duration = Duration::from_secs(1);

/// What is known of the board, and the next questions to it.
#[derive(Clone, Debug)]
pub(crate) struct Conversation {
    handshake: Handshake,
    board: Board,
    settings: Settings,
    /// The configuration has the ring: the board need not report it.
    ring_is_configured: bool,
    ring_is_told: bool,
    /// The board's counts continue, or its restart was noticed.
    is_trusted: bool,
    doubtful_since: Option<Timestamp>,
    last_group_at: Option<Timestamp>,
    trouble: String,
}

/// What a message's stamp says about the board's counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trust {
    /// They can be used.
    Yes,
    /// Unknown until the board identifies itself.
    Wait,
    /// They started again.
    Restarted,
}

impl Conversation {
    /// A conversation before its first message.
    #[must_use]
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            handshake: Handshake::default(),
            board: Board::default(),
            settings: Settings::new(config.settings()),
            ring_is_configured: config.ring.ring().is_some(),
            ring_is_told: false,
            is_trusted: false,
            doubtful_since: None,
            last_group_at: None,
            trouble: String::new(),
        }
    }

    /// What is known of the board.
    #[must_use]
    pub(crate) fn board(&self) -> &Board {
        &self.board
    }

    /// When [`Conversation::ask`] is due.
    #[must_use]
    pub(crate) fn deadline(&self) -> Timestamp {
        self.handshake.deadline()
    }

    /// The port was opened again.
    pub(crate) fn opened(&mut self, at: Timestamp) {
        self.handshake.opened(at);
        self.settings.restart();
        (self.is_trusted, self.last_group_at) = (false, None);
    }

    /// A valid frame arrived.
    pub(crate) fn heard(&mut self, at: Timestamp) {
        self.handshake.heard(at);
    }

    /// A sensor group arrived.
    pub(crate) fn fired(&mut self, at: Timestamp) {
        self.last_group_at = Some(at);
    }

    /// A HELLO arrived. True if the board restarted since the last one.
    pub(crate) fn hello(&mut self, hello: Hello, at: Timestamp, events: &mut Vec<Event>) -> bool {
        if hello.check_version().is_ok()
            && let Err(text) = Board::check(&hello)
        {
            self.trouble(text, at, events);
            return false;
        }
        let before = self.board.hello().copied();
        let restarted = self.board.greet(hello);
        // Other settings may mean another ring.
        self.ring_is_told &= before.is_some_and(|before| before.config_crc == hello.config_crc);
        let compatible = !self.board.is_refused();
        if before.is_none() || (!compatible && !self.is_trusted) {
            events.push(Event::Board { at, description: self.board.description(), compatible });
        }
        if !self.is_trusted {
            self.is_trusted = true;
            self.handshake.hurry(at);
        }
        restarted
    }

    /// Whether a message can be used; `continues` says whether its stamp continues the board's clock. After a new connection or a
    /// silence the counts may have started again. A board that neither continues nor identifies itself for a second restarted.
    pub(crate) fn trust(&mut self, at: Timestamp, continues: impl FnOnce() -> bool) -> Trust {
        if self.is_trusted || continues() {
            (self.is_trusted, self.doubtful_since) = (true, None);
            return Trust::Yes;
        }
        if *self.doubtful_since.get_or_insert(at) + SILENCE >= at {
            return Trust::Wait;
        }
        (self.is_trusted, self.doubtful_since) = (true, None);
        Trust::Restarted
    }

    /// The board restarted: asks everything again except the ring's geometry.
    pub(crate) fn restarted(&mut self, at: Timestamp) {
        self.handshake.restarted(at);
        self.settings.restart();
        self.last_group_at = None;
    }

    /// A part of the ring's geometry arrived. Returns the ring once all parts have arrived.
    pub(crate) fn geometry(&mut self, geometry: &Geometry, at: Timestamp, events: &mut Vec<Event>) -> Option<Ring> {
        match self.board.place(geometry) {
            Ok(Some(ring)) => {
                self.ring_is_told = true;
                self.handshake.hurry(at);
                Some(ring)
            }
            Ok(None) => None,
            Err(text) => {
                self.trouble(text, at, events);
                None
            }
        }
    }

    /// The value of a setting arrived.
    pub(crate) fn setting(&mut self, key: u8, value: i32, at: Timestamp) {
        self.settings.told(key, value);
        self.handshake.hurry(at);
    }

    /// The result of a command arrived.
    pub(crate) fn acknowledged(&mut self, of_type: u8, result: AckResult, at: Timestamp, events: &mut Vec<Event>) {
        if let Some(text) = self.settings.acknowledged(of_type, result) {
            self.trouble(text, at, events);
        }
        self.handshake.hurry(at);
    }

    /// A time request was written at `at`.
    pub(crate) fn time_request_sent(&mut self, token: u16, at: Timestamp) {
        self.handshake.time_request_sent(token, at);
    }

    /// When the request with this token was written; none if it was not the last one.
    pub(crate) fn time_request(&mut self, token: u16) -> Option<Timestamp> {
        self.handshake.time_request(token)
    }

    /// Messages to send to the board at `at`.
    pub(crate) fn ask(&mut self, at: Timestamp, events: &mut Vec<Event>) -> impl Iterator<Item = Message> + use<> {
        if self.last_group_at.is_some_and(|last| last + SILENCE < at) {
            (self.is_trusted, self.last_group_at) = (false, None);
        }
        let setting = self.settings.question();
        let known = Known {
            hello: self.is_trusted && self.board.hello().is_some(),
            setting: setting.clone(),
            ring: self.ring_is_told || self.ring_is_configured,
            streaming: self.last_group_at.is_some(),
            refused: self.is_trusted && self.board.is_refused(),
        };
        let messages = self.handshake.ask(at, known);
        if setting.is_some()
            && messages.question == setting
            && let Some(text) = self.settings.asked()
        {
            self.trouble(text, at, events);
        }
        messages.question.into_iter().chain(messages.time)
    }

    fn trouble(&mut self, text: String, at: Timestamp, events: &mut Vec<Event>) {
        if text != self.trouble {
            self.trouble.clone_from(&text);
            events.push(Event::BoardTrouble { at, text });
        }
    }
}
