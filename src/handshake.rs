//! What the host says to the board, and when: hello, geometry, start, and the time of day once a second.
//!
//! Opening the port resets many boards, and their boot loaders choke on early bytes: nothing is sent before the board has spoken
//! or 2.5 s have passed.

use crate::time::Timestamp;
use slamd_protocol::{Message, VERSION_MAJOR, VERSION_MINOR};
use std::time::Duration;

const SILENCE: Duration = Duration::from_millis(2500);
const RETRY: Duration = Duration::from_secs(1);

/// What has been learnt from the board so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known {
    /// HELLO was heard.
    pub hello: bool,
    /// The ring is known.
    pub ring: bool,
    /// Sonar messages arrive.
    pub streaming: bool,
    /// The board speaks another major version.
    pub refused: bool,
}

/// Decides what to ask next.
#[derive(Clone, Debug)]
pub struct Handshake {
    due: Timestamp,
    has_spoken: bool,
    token: u16,
    pending: Option<(u16, Timestamp)>,
}

impl Default for Handshake {
    fn default() -> Self {
        Self { due: Timestamp::default() + SILENCE, has_spoken: false, token: 0, pending: None }
    }
}

impl Handshake {
    /// The board has said something: it can be spoken to.
    pub fn heard(&mut self, at: Timestamp) {
        if !self.has_spoken {
            self.has_spoken = true;
            self.due = at;
        }
    }

    /// When [`Handshake::ask`] has something to say.
    #[must_use]
    pub fn deadline(&self) -> Timestamp {
        self.due
    }

    /// What to send at `at`: the next question of the handshake and, while a board is there, a time request.
    pub fn ask(&mut self, at: Timestamp, known: Known) -> impl Iterator<Item = Message> + use<> {
        self.due = at + RETRY;
        let question = match known {
            Known { refused: true, .. } => None,
            Known { hello: false, .. } => Some(Message::HelloRequest { major: VERSION_MAJOR, minor: VERSION_MINOR }),
            Known { ring: false, .. } => Some(Message::GeometryRequest),
            Known { streaming: false, .. } => Some(Message::Start),
            _ => None,
        };
        let time = (known.hello && !known.refused).then(|| {
            self.token = self.token.wrapping_add(1);
            Message::TimeRequest { token: self.token }
        });
        question.into_iter().chain(time)
    }

    /// Something new is known: ask the next question at once.
    pub fn hurry(&mut self, at: Timestamp) {
        self.due = at;
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
