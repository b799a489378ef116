//! What the host says to the board, and when: hello, settings, geometry, start, and the time of day twice a second.
//!
//! Opening the port resets many boards, and their boot loaders choke on early bytes: nothing is sent before the board has spoken
//! or 2.5 s have passed. What is not answered is asked again.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::time::Timestamp;
use bytes::Bytes;
use slamd_protocol::{FrameEncoder, Message, VERSION_MAJOR, VERSION_MINOR};
use std::time::Duration;

const SILENCE: Duration = Duration::from_millis(2500);
const RETRY: Duration = Duration::from_millis(300);
/// Nothing is asked while the ring is heard; this often it is looked whether it still is.
const CALM: Duration = Duration::from_secs(1);
/// The time is asked for this often, and at first more often, until the clock's rate is known.
const TIME_PERIOD: Duration = Duration::from_millis(500);
const QUICK_PERIOD: Duration = Duration::from_millis(50);
const QUICK_REQUESTS: u16 = 60;

/// What has been learnt from the board so far.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// HELLO was heard since the port was opened.
    pub hello: bool,
    /// The next question about the board's settings.
    pub setting: Option<Message>,
    /// The ring is known.
    pub ring: bool,
    /// Sonar messages arrive.
    pub streaming: bool,
    /// The board speaks another major version.
    pub refused: bool,
}

/// What to send.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Messages {
    /// The next question of the handshake.
    pub question: Option<Message>,
    /// What time is it?
    pub time: Option<Message>,
}

/// Decides what to ask next.
#[derive(Clone, Debug)]
pub struct Handshake {
    question_due: Timestamp,
    time_due: Timestamp,
    quick_requests: u16,
    has_spoken: bool,
    token: u16,
    pending: Option<(u16, Timestamp)>,
}

impl Default for Handshake {
    fn default() -> Self {
        let due = Timestamp::default() + SILENCE;
        Self { question_due: due, time_due: due, quick_requests: 0, has_spoken: false, token: 0, pending: None }
    }
}

impl Handshake {
    /// The port has been opened again: the board may be booting.
    pub fn opened(&mut self, at: Timestamp) {
        let due = at + SILENCE;
        *self = Self { question_due: due, time_due: due, token: self.token, ..Self::default() };
    }

    /// The board has said something: it can be spoken to.
    pub fn heard(&mut self, at: Timestamp) {
        if !self.has_spoken {
            self.has_spoken = true;
            self.hurry(at);
        }
    }

    /// When [`Handshake::ask`] has something to say.
    #[must_use]
    pub fn deadline(&self) -> Timestamp {
        self.question_due.min(self.time_due)
    }

    /// What to send at `at`: the next question of the handshake and, while a board is there, a time request.
    pub fn ask(&mut self, at: Timestamp, known: Known) -> Messages {
        let may_ask_time = known.hello && !known.refused;
        let question = (at >= self.question_due).then(|| question(known)).flatten();
        if at >= self.question_due {
            self.question_due = at + if question.is_some() { RETRY } else { CALM };
        }
        let asks_time = at >= self.time_due && may_ask_time;
        if at >= self.time_due {
            let is_quick = may_ask_time && self.quick_requests < QUICK_REQUESTS;
            self.quick_requests += u16::from(is_quick);
            self.time_due = at + if is_quick { QUICK_PERIOD } else { TIME_PERIOD };
        }
        let time = asks_time.then(|| {
            self.token = self.token.wrapping_add(1);
            Message::TimeRequest { token: self.token }
        });
        Messages { question, time }
    }

    /// Something new is known: ask the next question at once.
    pub fn hurry(&mut self, at: Timestamp) {
        (self.question_due, self.time_due) = (at, self.time_due.min(at));
    }

    /// The board's clock began anew: learn it quickly.
    pub fn clock_restarted(&mut self) {
        self.quick_requests = 0;
    }

    /// A time request has been written at `at`.
    pub fn time_request_sent(&mut self, token: u16, at: Timestamp) {
        self.pending = Some((token, at));
    }

    /// When the request with this token was written; none where it was not the last one.
    pub fn time_request(&mut self, token: u16) -> Option<Timestamp> {
        self.pending.take_if(|(pending, _)| *pending == token).map(|(_, at)| at)
    }
}

/// Asks who the board is and where its sensors are, whatever is known: a recording's next file holds the answers, too.
#[must_use]
pub fn introduction() -> [Bytes; 2] {
    let mut encoder = FrameEncoder::default();
    let hello = Message::HelloRequest { major: VERSION_MAJOR, minor: VERSION_MINOR };
    [hello, Message::GeometryRequest].map(|message| Bytes::copy_from_slice(&encoder.encode(&message)))
}

fn question(known: Known) -> Option<Message> {
    match known {
        Known { refused: true, .. } => None,
        Known { hello: false, .. } => Some(Message::HelloRequest { major: VERSION_MAJOR, minor: VERSION_MINOR }),
        Known { setting: Some(setting), .. } => Some(setting),
        Known { ring: false, .. } => Some(Message::GeometryRequest),
        Known { streaming: false, .. } => Some(Message::Start),
        _ => None,
    }
}
