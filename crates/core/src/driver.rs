//! Runs a pipeline over a session: live, from a capture or simulated, always alike.
//!
//! # The run loop
//!
//! [`Pipeline`] is a state machine that keeps no time. [`Driver`] gives it its inputs in the one order that makes live and replay equal:
//!
//! 1. **Every deadline that is due before an input is handled first, at the deadline's own time.** What the pipeline sees depends on
//!    what was read and written and when, never on when a timer fired or a thread woke.
//! 2. **Everything that an input causes is drained before the next input.** Each event and each frame for the board goes to the observer
//!    at once, in order, with the pipeline as it is after that input.
//!
//! So a recorded session replays bit for bit. A capture is driven like this:
//!
//! ```
//! use slamd_core::{Config, Driver, Event, Pipeline, Record, Start, Update};
//! # let records: Vec<Record> = Vec::new();
//! let mut driver = Driver::new(Pipeline::new(&Config::default(), Start::Fresh)?);
//! let mut poses = Vec::new();
//! let mut observe = |update: Update<'_>| {
//!     if let Update::Event(Event::Estimate(estimate)) = update {
//!         poses.push(estimate.pose);
//!     }
//! };
//! for record in &records {
//!     driver.feed(record, |_, update| observe(update));
//! }
//! driver.end(|_, update| observe(update));
//! let map = driver.pipeline().raster();
//! # Ok::<(), slamd_core::InvalidState>(())
//! ```
//!
//! A live program sleeps until [`Driver::next_deadline`] or until bytes come, and calls [`Driver::advance`] or [`Driver::handle`]. It writes
//! the frames of [`Update::Transmit`] to the board, and hands in what was really written as [`Input::Sent`]. A replay ignores these frames:
//! what was sent is in the capture.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::event::{Event, Input, Output};
use crate::geometry::Pose2;
use crate::link::Reception;
use crate::pipeline::Pipeline;
use crate::session_clock::SessionClock;
use crate::sweep::Sweep;
use crate::time::Timestamp;
use bytes::Bytes;
use std::time::Duration;

/// One message of a capture, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// Bytes read from the board.
    Received {
        /// When the read returned.
        at: Timestamp,
        /// The chunk, exactly as read.
        bytes: Vec<u8>,
    },
    /// Bytes written to the board.
    Sent {
        /// When the write returned.
        at: Timestamp,
        /// The chunk, exactly as written.
        bytes: Vec<u8>,
    },
    /// The port was opened again after a loss.
    Opened {
        /// When it was.
        at: Timestamp,
    },
    /// Where the robot truly was.
    Truth {
        /// When.
        at: Timestamp,
        /// `world_from_robot`.
        pose: Pose2,
    },
}

impl Record {
    /// The record's time.
    #[must_use]
    pub const fn at(&self) -> Timestamp {
        match self {
            Self::Received { at, .. } | Self::Sent { at, .. } | Self::Opened { at } | Self::Truth { at, .. } => *at,
        }
    }

    /// The record as the pipeline's input; none for the truth, which no robot has.
    #[must_use]
    pub fn input(&self) -> Option<Input<'_>> {
        match self {
            Self::Received { at, bytes } => Some(Input::Received { at: *at, bytes }),
            Self::Sent { at, bytes } => Some(Input::Sent { at: *at, bytes }),
            Self::Opened { at } => Some(Input::Opened { at: *at }),
            Self::Truth { .. } => None,
        }
    }
}

/// What an observer of a session gets to see, in order.
#[derive(Clone, Copy, Debug)]
pub enum Update<'a> {
    /// An event of the pipeline.
    Event(&'a Event),
    /// A frame to be written to the board.
    Transmit(&'a Bytes),
    /// Where the robot truly was.
    Truth(Timestamp, Pose2),
    /// An input has been handled; its events and frames came before.
    Input,
}

/// The state in which an [`Update`] happens.
pub struct Context<'a> {
    /// The pipeline after the input that caused it.
    pub pipeline: &'a Pipeline,
    /// Session time.
    pub now: Timestamp,
    /// How long the pipeline took for that input; zero without [`Driver::with_stopwatch`].
    pub took: Duration,
}

/// Observes a session. It must not wait: the pipeline runs on the same thread.
pub type Watcher = Box<dyn FnMut(&Context<'_>, Update<'_>)>;

/// A pipeline and its session time. The crate page has the run loop.
#[derive(Debug)]
pub struct Driver {
    pipeline: Pipeline,
    clock: SessionClock,
    stopwatch: fn() -> Duration,
}

impl Driver {
    /// A driver of a pipeline that has handled no input yet.
    #[must_use]
    pub const fn new(pipeline: Pipeline) -> Self {
        Self { pipeline, clock: SessionClock::new(), stopwatch: || Duration::ZERO }
    }

    /// Measures [`Context::took`] with a clock that never runs back. It is for reports only and changes nothing else.
    #[must_use]
    pub const fn with_stopwatch(mut self, stopwatch: fn() -> Duration) -> Self {
        self.stopwatch = stopwatch;
        self
    }

    /// Handles a record, after every deadline that is due before it. The truth does not move session time: a live session has none, and
    /// must be equal.
    pub fn feed(&mut self, record: &Record, mut observe: impl FnMut(&Context<'_>, Update<'_>)) {
        match (record, record.input()) {
            (Record::Truth { at, pose }, _) => observe(&self.context(Duration::ZERO), Update::Truth(*at, *pose)),
            (_, Some(input)) => self.handle(input, observe),
            (_, None) => {}
        }
    }

    /// Handles an input, after every deadline that is due before it. An input whose time is earlier than the last one's is handled at the
    /// last one's: session time never runs back.
    pub fn handle(&mut self, input: Input<'_>, mut observe: impl FnMut(&Context<'_>, Update<'_>)) {
        let input = match input {
            Input::Received { at, bytes } => Input::Received { at: self.advance(at, &mut observe), bytes },
            Input::Sent { at, bytes } => Input::Sent { at: self.advance(at, &mut observe), bytes },
            Input::Opened { at } => Input::Opened { at: self.advance(at, &mut observe) },
            Input::Tick { at } => {
                self.advance(at, &mut observe);
                return;
            }
            Input::End => Input::End,
        };
        self.step(input, &mut observe);
    }

    /// Handles the deadlines up to `at`, each at its own time. Gives session time after that: `at`, or the last input's time where that is
    /// later.
    pub fn advance(&mut self, at: Timestamp, mut observe: impl FnMut(&Context<'_>, Update<'_>)) -> Timestamp {
        let at = self.clock.approach(at);
        while let Some(deadline) = self.clock.due(at, self.pipeline.next_deadline()) {
            self.step(Input::Tick { at: deadline }, &mut observe);
        }
        at
    }

    /// Ends the session: sweeps that wait in the pipeline are used.
    pub fn end(&mut self, mut observe: impl FnMut(&Context<'_>, Update<'_>)) {
        self.step(Input::End, &mut observe);
    }

    /// When to call [`Driver::advance`], unless an input comes earlier.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.pipeline.next_deadline()
    }

    /// Session time: that of the last input.
    #[must_use]
    pub const fn now(&self) -> Timestamp {
        self.clock.now()
    }

    /// The pipeline, to read its state.
    #[must_use]
    pub const fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// What has been received so far, as the link watches it.
    #[must_use]
    pub fn reception(&self) -> Reception<'_> {
        let counters = self.pipeline.counters();
        Reception {
            frames: counters.frames,
            groups: counters.groups,
            restarts: counters.restarts,
            echoed: counters.echoed,
            board: self.pipeline.board(),
            trouble: self.pipeline.line_trouble(),
            waits_for_movement: self.pipeline.waits_for_movement(),
        }
    }

    /// Keeps each sweep for [`Driver::take_sweeps`].
    pub fn keep_sweeps(&mut self) {
        self.pipeline.keep_sweeps();
    }

    /// The sweeps since the last call, where they are kept.
    pub fn take_sweeps(&mut self) -> Vec<Sweep> {
        self.pipeline.take_sweeps()
    }

    /// Hands one input to the pipeline and drains it.
    fn step(&mut self, input: Input<'_>, observe: &mut impl FnMut(&Context<'_>, Update<'_>)) {
        let begin = (self.stopwatch)();
        self.pipeline.handle(input);
        let took = (self.stopwatch)().saturating_sub(begin);
        while let Some(output) = self.pipeline.poll_output() {
            let update = match &output {
                Output::Transmit(frame) => Update::Transmit(frame),
                Output::Event(event) => Update::Event(event),
            };
            observe(&self.context(took), update);
        }
        observe(&self.context(took), Update::Input);
    }

    const fn context(&self, took: Duration) -> Context<'_> {
        Context { pipeline: &self.pipeline, now: self.clock.now(), took }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::pipeline::Start;

    fn driver() -> Driver {
        Driver::new(Pipeline::new(&Config::default(), Start::Fresh).expect("a fresh start"))
    }

    fn ms(ms: u64) -> Timestamp {
        Timestamp::from_us(ms * 1_000)
    }

    /// When inputs were handled, and the frames for the board.
    fn seen(feed: impl FnOnce(&mut Driver, &mut dyn FnMut(&Context<'_>, Update<'_>))) -> (Vec<Timestamp>, Vec<Bytes>) {
        let (mut inputs, mut frames) = (Vec::new(), Vec::new());
        feed(&mut driver(), &mut |context, update| match update {
            Update::Input => inputs.push(context.now),
            Update::Transmit(frame) => frames.push(frame.clone()),
            Update::Event(_) | Update::Truth(..) => {}
        });
        (inputs, frames)
    }

    #[test]
    fn deadlines_before_a_record_are_handled_at_their_own_time() {
        let record = Record::Received { at: ms(3_000), bytes: vec![0] };
        let (inputs, frames) = seen(|driver, observe| driver.feed(&record, observe));
        assert!(inputs.len() > 2 && !frames.is_empty(), "{inputs:?}");
        assert_eq!((inputs.first(), inputs.last()), (Some(&driver().next_deadline()), Some(&ms(3_000))));
    }

    #[test]
    fn a_timer_that_wakes_at_any_time_changes_nothing() {
        let record = Record::Opened { at: ms(5_000) };
        let replayed = seen(|driver, observe| driver.feed(&record, observe));
        let live = seen(|driver, observe| {
            for at in (0..5_000).step_by(37) {
                driver.advance(ms(at), &mut *observe);
            }
            driver.feed(&record, observe);
        });
        assert_eq!(replayed, live);
    }

    #[test]
    fn the_truth_moves_no_clock() {
        let mut driver = driver();
        let mut truths = 0;
        driver.feed(&Record::Truth { at: ms(9_000), pose: Pose2::default() }, |_, update| {
            truths += usize::from(matches!(update, Update::Truth(..)));
        });
        assert_eq!((driver.now(), truths), (Timestamp::default(), 1));
    }
}
