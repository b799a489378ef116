//! Link health: state, cause, recovery action.
//!
//! ```text
//! Searching → Listening → Handshake → Streaming ⇄ Stale (0.5 s) → Lost (2 s)
//!     ↑____________________ the port is gone, from anywhere ____________|
//! ```
//!
//! A state machine without I/O, like the pipeline: opened, received and closed go in; changes of state with their cause, and
//! remedies (another baud rate, reopening the port) come out. The daemon applies the remedies.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod cause;

use crate::board::Board;
use crate::time::Timestamp;
use std::collections::VecDeque;
use std::time::Duration;

pub use cause::LinkCause;

/// State of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinkState {
    /// No port is open.
    #[default]
    Searching,
    /// The port is open; no frame has arrived.
    Listening,
    /// Frames arrive; sensor groups do not yet.
    Handshake,
    /// Sensor groups arrive.
    Streaming,
    /// No sensor group for half a second.
    Stale,
    /// No sensor group for two seconds.
    Lost,
}

impl LinkState {
    /// All states.
    pub const ALL: [Self; 6] =
        [Self::Searching, Self::Listening, Self::Handshake, Self::Streaming, Self::Stale, Self::Lost];

    /// The word used in logs.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Searching => "searching",
            Self::Listening => "listening",
            Self::Handshake => "handshake",
            Self::Streaming => "streaming",
            Self::Stale => "stale",
            Self::Lost => "lost",
        }
    }
}

/// A change of state, or a new cause of the same state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkChange {
    /// When.
    pub at: Timestamp,
    /// The state from now on.
    pub state: LinkState,
    /// Why; its text says what to do.
    pub cause: LinkCause,
}

impl std::fmt::Display for LinkChange {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "link: {} ({})", self.state.word(), self.cause)
    }
}

/// What the daemon should do to the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// Set this many bits per second.
    Baud(u32),
    /// Close the port and open it again.
    Reopen,
}

/// What the pipeline has received since its start.
#[derive(Clone, Copy, Debug)]
pub struct Reception<'a> {
    /// Valid frames.
    pub frames: u64,
    /// Sensor groups.
    pub groups: u64,
    /// Restarts of the board.
    pub restarts: u64,
    /// The host's own messages, received back.
    pub echoed: u64,
    /// The board.
    pub board: &'a Board,
    /// What is wrong with the line or with what the board says of itself.
    pub trouble: Option<&'a str>,
    /// Sweeps arrive, but the robot has not moved yet.
    pub waits_for_movement: bool,
}

/// Usual rates of boards and bridges, likeliest first.
pub const USUAL_BAUDS: [u32; 8] = [115_200, 250_000, 500_000, 1_000_000, 57_600, 38_400, 19_200, 9_600];

/// Time for a board to boot after opening the port reset it, and to speak or answer.
const FIRST_WORD: Duration = Duration::from_millis(4_000);
/// Listening time at each further baud rate.
const BAUD_TRIAL: Duration = Duration::from_millis(1_500);
/// Pause after all rates failed, before they are tried again.
const BAUD_PAUSE: Duration = Duration::from_secs(30);
/// A board that answers should fire its sensors within this time.
const FIRST_ECHO: Duration = Duration::from_secs(5);
const STALE: Duration = Duration::from_millis(500);
const LOST: Duration = Duration::from_secs(2);
/// Bytes arrive if the last ones are younger than this.
const BYTES_ARRIVE: Duration = Duration::from_millis(300);
/// A link silent for this long is reopened.
const REOPEN: Duration = Duration::from_secs(10);
/// A tick this late means that the machine slept or the program was stopped, seconds.
const ASLEEP_S: f64 = 0.5;
/// This many restarts within this time are reported.
const RESTARTS: usize = 3;
const RESTARTS_WITHIN_S: f64 = 30.0;
/// Bytes kept to distinguish text from noise, and the minimum for a decision.
const SAMPLE: usize = 96;
const MIN_TEXT: usize = 24;

/// The link to the board.
#[derive(Clone, Debug)]
pub struct Link {
    state: LinkState,
    cause: LinkCause,
    port: String,
    wanted_baud: u32,
    baud: u32,
    /// Index of the next usual rate to try.
    trial: usize,
    /// Start of the current wait: the opening, a new rate, the first frame, the last echo.
    since: Timestamp,
    /// Bytes, frames and sensor groups at that time.
    bytes: u64,
    frames: u64,
    groups: u64,
    heard_at: Timestamp,
    sample: VecDeque<u8>,
    restarts: u64,
    restarted: VecDeque<Timestamp>,
    changes: VecDeque<LinkChange>,
    remedy: Option<Remedy>,
}

impl Link {
    /// A link whose port is not open, configured for `baud`.
    #[must_use]
    pub fn new(baud: u32) -> Self {
        Self {
            state: LinkState::Searching,
            cause: LinkCause::NotOpened,
            port: String::new(),
            wanted_baud: baud,
            baud,
            trial: 0,
            since: Timestamp::default(),
            bytes: 0,
            frames: 0,
            groups: 0,
            heard_at: Timestamp::default(),
            sample: VecDeque::with_capacity(SAMPLE),
            restarts: 0,
            restarted: VecDeque::with_capacity(RESTARTS),
            changes: VecDeque::new(),
            remedy: None,
        }
    }

    /// Current state.
    #[must_use]
    pub fn state(&self) -> LinkState {
        self.state
    }

    /// Cause of the state.
    #[must_use]
    pub fn cause(&self) -> &LinkCause {
        &self.cause
    }

    /// Current bits per second: open the port with these.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.baud
    }

    /// The port could not be opened, or is gone.
    pub fn closed(&mut self, at: Timestamp, cause: impl Into<String>) {
        self.remedy = None;
        self.change(at, LinkState::Searching, LinkCause::Closed(cause.into()));
    }

    /// The port named `port` is open.
    pub fn opened(&mut self, at: Timestamp, port: impl Into<String>, reception: &Reception<'_>) {
        self.port = port.into();
        self.trial = 0;
        self.listen(at, reception);
        let cause = LinkCause::Opened { port: self.port.clone(), baud: self.baud };
        self.change(at, LinkState::Listening, cause);
    }

    /// `bytes` were read and passed to the pipeline, which has received `reception` by now.
    pub fn heard(&mut self, at: Timestamp, bytes: &[u8], reception: &Reception<'_>) {
        self.heard_at = at;
        self.bytes += bytes.len() as u64;
        self.sample.extend(bytes.iter().skip(bytes.len().saturating_sub(SAMPLE)));
        self.sample.drain(..self.sample.len().saturating_sub(SAMPLE));
        self.count_restarts(at, reception);
        if reception.groups > self.groups {
            (self.groups, self.since) = (reception.groups, at);
            self.stream(at, reception);
        } else if self.state == LinkState::Listening && reception.frames > self.frames {
            self.greet(at, reception);
        } else if self.state == LinkState::Handshake
            && let Some(refusal) = reception.board.refusal()
        {
            self.change(at, LinkState::Handshake, LinkCause::Refused(refusal));
        }
    }

    /// Time has passed; due at [`Link::deadline`].
    pub fn tick(&mut self, at: Timestamp, reception: &Reception<'_>) {
        let Some(deadline) = self.deadline().filter(|deadline| *deadline <= at) else { return };
        if at.seconds_since(deadline) > ASLEEP_S {
            // The program did not run, so it missed the bytes: the wait starts now.
            self.since = at;
            return;
        }
        match self.state {
            LinkState::Searching => {}
            LinkState::Listening => self.try_on(at, reception),
            LinkState::Handshake => {
                self.since = at;
                if !reception.board.is_refused() {
                    let cause = reception.trouble.map_or(LinkCause::NoPings, |text| LinkCause::Trouble(text.into()));
                    self.change(at, LinkState::Handshake, cause);
                }
            }
            LinkState::Streaming => self.change(at, LinkState::Stale, self.no_echoes(at, STALE)),
            LinkState::Stale => self.change(at, LinkState::Lost, self.no_echoes(at, LOST)),
            LinkState::Lost if self.heard_at + LOST <= at => {
                self.remedy = Some(Remedy::Reopen);
                self.since = at;
            }
            LinkState::Lost if reception.frames > self.frames => (self.since, self.frames) = (at, reception.frames),
            // Bytes, and not one valid frame: it may speak at another rate by now.
            LinkState::Lost => {
                self.trial = 0;
                self.try_on(at, reception);
            }
        }
    }

    /// When [`Link::tick`] is due; none without a wait.
    #[must_use]
    pub fn deadline(&self) -> Option<Timestamp> {
        let wait = match self.state {
            LinkState::Searching => return None,
            LinkState::Listening if self.trial == 0 => FIRST_WORD,
            LinkState::Listening if self.trial <= USUAL_BAUDS.len() => BAUD_TRIAL,
            LinkState::Listening => BAUD_PAUSE,
            LinkState::Handshake => FIRST_ECHO,
            LinkState::Streaming => STALE,
            LinkState::Stale => LOST,
            LinkState::Lost => REOPEN,
        };
        Some(self.since + wait)
    }

    /// The next change.
    pub fn poll_change(&mut self) -> Option<LinkChange> {
        self.changes.pop_front()
    }

    /// What to do to the port now, if anything.
    pub fn take_remedy(&mut self) -> Option<Remedy> {
        self.remedy.take()
    }

    fn change(&mut self, at: Timestamp, state: LinkState, cause: LinkCause) {
        if state != self.state || cause != self.cause {
            (self.state, self.cause) = (state, cause.clone());
            self.changes.push_back(LinkChange { at, state, cause });
        }
    }

    /// Sensor groups arrive.
    fn stream(&mut self, at: Timestamp, reception: &Reception<'_>) {
        let cause = match reception.trouble {
            Some(text) => LinkCause::Trouble(text.into()),
            None if reception.waits_for_movement => LinkCause::WaitsForMovement,
            None => LinkCause::EchoesArrive { port: self.port.clone(), baud: self.baud },
        };
        self.change(at, LinkState::Streaming, cause);
    }

    /// Restarts the wait and its counts.
    fn listen(&mut self, at: Timestamp, reception: &Reception<'_>) {
        (self.since, self.heard_at) = (at, at);
        (self.bytes, self.frames, self.groups) = (0, reception.frames, reception.groups);
        self.sample.clear();
    }

    /// The first valid frame arrived.
    fn greet(&mut self, at: Timestamp, reception: &Reception<'_>) {
        self.since = at;
        let cause = if reception.echoed == reception.frames {
            LinkCause::Echo
        } else if let Some(refusal) = reception.board.refusal() {
            LinkCause::Refused(refusal)
        } else if self.baud == self.wanted_baud {
            LinkCause::BoardSpeaks { baud: self.baud }
        } else {
            LinkCause::OtherBaud { found: self.baud, wanted: self.wanted_baud }
        };
        self.change(at, LinkState::Handshake, cause);
    }

    /// No valid frame arrived at this rate: reports what did, and tries the next.
    fn try_on(&mut self, at: Timestamp, reception: &Reception<'_>) {
        if let Some(text) = self.text() {
            if !matches!(self.cause, LinkCause::WrongFirmware { .. }) {
                self.change(at, LinkState::Listening, LinkCause::WrongFirmware { text });
            }
            return self.listen(at, reception);
        }
        if self.trial == 0 {
            let baud = self.baud;
            let cause = if self.bytes > 0 { LinkCause::Noise { baud } } else { LinkCause::Silence { baud } };
            self.change(at, LinkState::Listening, cause);
        }
        let next = USUAL_BAUDS.iter().skip(self.trial).position(|&baud| baud != self.wanted_baud);
        let baud = next.and_then(|next| USUAL_BAUDS.get(self.trial + next).copied());
        match (next, baud) {
            (Some(next), Some(baud)) => {
                self.trial += next + 1;
                self.baud = baud;
            }
            _ if self.trial > USUAL_BAUDS.len() => {
                self.trial = 0;
                return self.try_on(at, reception);
            }
            _ => {
                (self.trial, self.baud) = (USUAL_BAUDS.len() + 1, self.wanted_baud);
                let cause = match self.cause {
                    LinkCause::Noise { .. } | LinkCause::NoiseAtAllRates => LinkCause::NoiseAtAllRates,
                    _ => LinkCause::SilenceAtAllRates,
                };
                self.change(at, LinkState::Listening, cause);
            }
        }
        self.remedy = Some(Remedy::Baud(self.baud));
        self.listen(at, reception);
    }

    /// Start of the text that the board prints, if it prints text.
    fn text(&self) -> Option<String> {
        let is_text = |byte: &u8| (b' '..=b'~').contains(byte) || matches!(byte, b'\r' | b'\n' | b'\t');
        let printed = self.sample.iter().filter(|byte| is_text(byte)).count();
        if self.sample.len() < MIN_TEXT || printed * 20 < self.sample.len() * 19 {
            return None;
        }
        let text: String = self.sample.iter().copied().filter(is_text).map(char::from).collect();
        let line =
            text.split(|c: char| c.is_control()).map(str::trim).max_by_key(|line| line.len()).unwrap_or_default();
        Some(line.chars().take(40).collect())
    }

    fn no_echoes(&self, at: Timestamp, elapsed: Duration) -> LinkCause {
        LinkCause::NoEchoes { elapsed, do_bytes_arrive: self.heard_at + BYTES_ARRIVE > at }
    }

    fn count_restarts(&mut self, at: Timestamp, reception: &Reception<'_>) {
        if reception.restarts == self.restarts {
            return;
        }
        self.restarts = reception.restarts;
        self.restarted.push_back(at);
        self.restarted.drain(..self.restarted.len().saturating_sub(RESTARTS));
        let is_often = self.restarted.len() == RESTARTS
            && self.restarted.front().is_some_and(|first| at.seconds_since(*first) < RESTARTS_WITHIN_S);
        if is_often {
            self.restarted.clear();
            self.change(at, self.state, LinkCause::Restarts);
        }
    }
}
