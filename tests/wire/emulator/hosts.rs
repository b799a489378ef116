//! Who may hold the host's end of the emulated board's line.

#![allow(unreachable_pub, reason = "a test's module")]

use super::emulation::Host;
use super::mock_port::Terminal;
use slamd::source::session::Session;
use slamd_capture::{CaptureReader, CaptureWriter, Record};
use slamd_core::{Pose2, Timestamp};
use slamd_publish::Summary;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

/// The real program on a pseudo-terminal, in real time.
pub struct Wire {
    pub terminal: Terminal,
    begin: Instant,
    begin_unix_us: u64,
    /// Unix time in microseconds and the true pose at that time. A machine in a hurry may run the board late, and then faster to catch up;
    /// the board's clock knows nothing of that, so the times are those at which it should have been there.
    pub truth: Vec<(u64, Pose2)>,
    pub lost_bytes: usize,
    /// The most that the board was behind the wall clock.
    pub late: Duration,
}

/// Later than this the board's time stands still instead.
const MAX_LATE: Duration = Duration::from_millis(100);

impl Wire {
    #[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
    pub fn new() -> Self {
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("after 1970");
        let begin_unix_us = u64::try_from(since_1970.as_micros()).expect("before the year 500000");
        Self {
            terminal: Terminal::open(),
            begin: Instant::now(),
            begin_unix_us,
            truth: Vec::new(),
            lost_bytes: 0,
            late: Duration::ZERO,
        }
    }
}

impl Host for Wire {
    #[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        let (due, now) = (self.begin + Duration::from_micros(at_us), Instant::now());
        std::thread::sleep(due.saturating_duration_since(now));
        let late = now.saturating_duration_since(due);
        self.late = self.late.max(late);
        if late > MAX_LATE {
            // A board does not send faster to catch up.
            self.begin += late;
            self.begin_unix_us += u64::try_from(late.as_micros()).expect("not that late");
        }
        self.lost_bytes += self.terminal.write(bytes);
        self.terminal.read()
    }

    fn truth(&mut self, at_us: u64, pose: Pose2) {
        self.truth.push((self.begin_unix_us + at_us, pose));
    }
}

/// A session in the emulated time, and on request the capture of all that it reads and writes.
pub struct Recording {
    session: Session,
    capture: Option<CaptureWriter>,
}

impl Recording {
    pub fn new(session: Session, capture: Option<CaptureWriter>) -> Self {
        Self { session, capture }
    }

    pub fn finish(self) -> Summary {
        self.capture.into_iter().for_each(|capture| capture.finish().expect("written"));
        self.session.finish().expect("written").0
    }
}

impl Host for Recording {
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        let at = Timestamp::from_us(at_us);
        self.session.run_until(at);
        if !bytes.is_empty() {
            self.capture.iter_mut().for_each(|capture| capture.received(at, bytes).expect("written"));
            self.session.received(at, bytes);
        }
        let mut written = Vec::new();
        for frame in self.session.take_transmit() {
            self.capture.iter_mut().for_each(|capture| capture.sent(at, &frame).expect("written"));
            self.session.sent(at, &frame);
            written.extend_from_slice(&frame);
        }
        written
    }

    fn truth(&mut self, at_us: u64, pose: Pose2) {
        let at = Timestamp::from_us(at_us);
        self.capture.iter_mut().for_each(|capture| capture.truth(at, pose).expect("written"));
        self.session.truth(at, pose).expect("written");
    }
}

/// Sends what a capture's host sent, and notes what the board sends.
pub struct Script {
    sent: Vec<(u64, Vec<u8>)>,
    next: usize,
    pub heard: Vec<(u64, Vec<u8>)>,
}

impl Script {
    pub fn new(capture: &Path) -> Self {
        let mut sent: Vec<(u64, Vec<u8>)> = Vec::new();
        for record in CaptureReader::open(capture).expect("a capture") {
            if let Record::Sent { at, bytes } = record.expect("a whole capture") {
                sent.push((at.us(), bytes));
            }
        }
        Self { sent, next: 0, heard: Vec::new() }
    }
}

impl Host for Script {
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        if !bytes.is_empty() {
            self.heard.push((at_us, bytes.to_vec()));
        }
        let due = self.sent[self.next..].iter().take_while(|(us, _)| *us <= at_us);
        let written: Vec<Vec<u8>> = due.map(|(_, bytes)| bytes.clone()).collect();
        self.next += written.len();
        written.concat()
    }

    fn truth(&mut self, _: u64, _: Pose2) {}
}
