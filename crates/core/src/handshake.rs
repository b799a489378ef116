//! What the host sends to the board, and when: hello, settings, geometry, start, and a time request twice a second.
//!
//! Opening the port resets many boards, and early bytes confuse their boot loaders. So the host sends nothing before the board
//! has spoken or 2.5 s have passed. Unanswered questions are repeated.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::time::Timestamp;
use bytes::Bytes;
use slamd_protocol::{FrameEncoder, Message, VERSION_MAJOR, VERSION_MINOR};
use std::time::Duration;

const SILENCE: Duration = Duration::from_millis(2500);
const RETRY: Duration = Duration::from_millis(300);
/// No questions are sent while sensor groups arrive; this often the handshake checks whether they still do.
const CALM: Duration = Duration::from_secs(1);
/// Period of time requests, and the shorter one of the first requests, until the clock's rate is known.
const TIME_PERIOD: Duration = Duration::from_millis(500);
const QUICK_PERIOD: Duration = Duration::from_millis(50);
const QUICK_REQUESTS: u16 = 60;

/// What the board has answered so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    /// HELLO arrived since the port was opened.
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
pub(crate) struct Messages {
    /// The next question of the handshake.
    pub question: Option<Message>,
    /// The next time request.
    pub time: Option<Message>,
}

/// Decides what to ask next.
#[derive(Clone, Debug)]
pub(crate) struct Handshake {
    question_due: Timestamp,
    /// The last question and when it was asked: the same one is not asked again before [`RETRY`], whatever its answer.
    asked: Option<(Message, Timestamp)>,
    time_due: Timestamp,
    /// No time request goes out before this.
    time_not_before: Timestamp,
    quick_requests: u16,
    has_spoken: bool,
    token: u16,
    pending: Option<(u16, Timestamp)>,
}

impl Default for Handshake {
    fn default() -> Self {
        let due = Timestamp::default() + SILENCE;
        Self {
            question_due: due,
            asked: None,
            time_due: due,
            time_not_before: due,
            quick_requests: 0,
            has_spoken: false,
            token: 0,
            pending: None,
        }
    }
}

impl Handshake {
    /// The port was opened again: the board may be booting.
    pub(crate) fn opened(&mut self, at: Timestamp) {
        let due = at + SILENCE;
        *self = Self { question_due: due, time_due: due, time_not_before: due, token: self.token, ..Self::default() };
    }

    /// The board sent something: it listens, too.
    pub(crate) fn heard(&mut self, at: Timestamp) {
        if !self.has_spoken {
            self.has_spoken = true;
            self.time_not_before = self.time_not_before.min(at);
            self.hurry(at);
        }
    }

    /// When [`Handshake::ask`] is due.
    #[must_use]
    pub(crate) fn deadline(&self) -> Timestamp {
        self.question_due.min(self.time_due)
    }

    /// Messages to send at `at`: the handshake's next question and, once the board is known, a time request.
    pub(crate) fn ask(&mut self, at: Timestamp, known: Known) -> Messages {
        let may_ask_time = known.hello && !known.refused;
        let mut question = (at >= self.question_due).then(|| question(known)).flatten();
        if at >= self.question_due {
            let again =
                self.asked.as_ref().filter(|(asked, _)| question.as_ref() == Some(asked)).map(|(_, at)| *at + RETRY);
            match again.filter(|again| at < *again) {
                Some(again) => (question, self.question_due) = (None, again),
                None if question.is_some() => {
                    self.asked = question.clone().map(|question| (question, at));
                    self.question_due = at + RETRY;
                }
                None => self.question_due = at + CALM,
            }
        }
        let asks_time = at >= self.time_due && may_ask_time;
        if at >= self.time_due {
            let is_quick = may_ask_time && self.quick_requests < QUICK_REQUESTS;
            self.quick_requests += u16::from(is_quick);
            self.time_due = at + if is_quick { QUICK_PERIOD } else { TIME_PERIOD };
        }
        let time = asks_time.then(|| {
            self.time_not_before = at + QUICK_PERIOD;
            self.token = self.token.wrapping_add(1);
            Message::TimeRequest { token: self.token }
        });
        Messages { question, time }
    }

    /// An answer arrived: the next question is due at once.
    pub(crate) fn hurry(&mut self, at: Timestamp) {
        self.question_due = at;
        self.time_due = self.time_due.min(at.max(self.time_not_before));
    }

    /// The board restarted: asks again at once, and sends the quick time requests again.
    pub(crate) fn restarted(&mut self, at: Timestamp) {
        (self.asked, self.quick_requests) = (None, 0);
        self.hurry(at);
    }

    /// A time request was written at `at`.
    pub(crate) fn time_request_sent(&mut self, token: u16, at: Timestamp) {
        self.pending = Some((token, at));
    }

    /// When the request with this token was written; none if it was not the last one.
    pub(crate) fn time_request(&mut self, token: u16) -> Option<Timestamp> {
        self.pending.take_if(|(pending, _)| *pending == token).map(|(_, at)| at)
    }
}

/// Asks for the board's identity and geometry again, so that the next file of a recording holds the answers.
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
