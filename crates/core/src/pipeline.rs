//! The whole method, in order.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`
//!
//! A pipeline is a state machine without a clock, a file or a thread: [`Pipeline::handle`] takes what was read, what was
//! written and which deadline has come; [`Pipeline::poll_output`] gives what to write and what has happened. Drain it before
//! the next input. The same inputs give the same outputs, so a recorded session replays bit for bit.
//!
//! The steps from the sweep on are those of the chosen method: [`crate::wall_slam`] or [`slamd_paper`].

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod estimator;
mod introspection;
mod stray_text;
mod troubles;

pub use crate::align::trouble::Topic;
pub use estimator::{Estimator, Methods, Start, Waiting, built_in};

use crate::align::track::Wheels;
use crate::align::{Aligner, Restarted};
use crate::board::Board;
use crate::config::Config;
use crate::conversation::{Conversation, Trust};
use crate::event::{Calibration, Counters, Event, Input, Output, SensorState};
use crate::geometry::Ring;
use crate::mapping::raster::Raster;
use crate::params::Params;
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::Sweep;
use crate::time::Timestamp;
use bytes::Bytes;
use slamd_protocol::{DELIMITER, Encoder, FrameDecoder, FrameEncoder, Hello, Message, MessageError, Motion, Sonar};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use stray_text::StrayText;
use troubles::Noted;

/// From the board's bytes to the robot's map.
#[derive(Debug)]
pub struct Pipeline {
    config: Config,
    decoder: FrameDecoder,
    sent: FrameDecoder,
    encoder: FrameEncoder,
    conversation: Conversation,
    aligner: Aligner,
    start: Start,
    methods: Methods,
    params: Params,
    estimator: Option<Box<dyn Estimator>>,
    /// Which encoders' counts the aligner turns over, left and right.
    reversed: [bool; 2],
    kept_sweeps: Option<Vec<Sweep>>,
    last_seq: Option<u8>,
    text: StrayText,
    noted: Noted,
    counters: Counters,
    /// What the board's motors do, since it said so.
    motion: Option<Motion>,
    events: Vec<Event>,
    outputs: VecDeque<Output>,
}

impl Pipeline {
    /// A pipeline that has heard nothing yet, with the methods of this crate.
    ///
    /// # Errors
    /// Where the start's saved state is invalid, or the configured method is not there or cannot use it.
    pub fn new(config: &Config, start: Start) -> Result<Self, InvalidState> {
        Self::with_methods(config, start, built_in)
    }

    /// A pipeline that chooses among other methods, too.
    ///
    /// # Errors
    /// As [`Pipeline::new`].
    pub fn with_methods(config: &Config, start: Start, methods: Methods) -> Result<Self, InvalidState> {
        Self::with_params(config, start, methods, Params::default())
    }

    /// A pipeline whose default method has other constants.
    ///
    /// # Errors
    /// As [`Pipeline::new`].
    pub fn with_params(config: &Config, start: Start, methods: Methods, params: Params) -> Result<Self, InvalidState> {
        // The ring may become known later; whether the start can be used is said now.
        methods(config, &Ring::default(), &start, &params)?;
        Ok(Self::start(config, start, methods, params))
    }

    fn start(config: &Config, start: Start, methods: Methods, params: Params) -> Self {
        let mut pipeline = Self {
            config: config.clone(),
            decoder: FrameDecoder::new(),
            sent: FrameDecoder::new(),
            encoder: FrameEncoder::default(),
            conversation: Conversation::new(config),
            aligner: Aligner::with_params(&config.ring, config.robot.max_speed_m_s, params.align),
            start,
            methods,
            params,
            estimator: None,
            reversed: [false; 2],
            kept_sweeps: None,
            last_seq: None,
            text: StrayText::new(),
            noted: Noted::default(),
            counters: Counters::default(),
            motion: None,
            events: Vec::new(),
            outputs: VecDeque::new(),
        };
        if let Some(ring) = config.ring.ring() {
            pipeline.use_ring(ring, Timestamp::default());
        }
        if let Some(ticks) = config.robot.ticks_per_turn {
            pipeline.use_ticks(ticks);
        }
        pipeline
    }

    /// The effective configuration.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Keeps each sweep for [`Pipeline::take_sweeps`].
    pub fn keep_sweeps(&mut self) {
        self.kept_sweeps = Some(Vec::new());
    }

    /// The sweeps since the last call, where they are kept.
    pub fn take_sweeps(&mut self) -> Vec<Sweep> {
        self.kept_sweeps.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Takes one input. Never fails: what is wrong with it becomes an event or a counter.
    pub fn handle(&mut self, input: Input<'_>) {
        match input {
            Input::Received { at, bytes } => {
                for &byte in bytes {
                    self.received(byte, at);
                }
            }
            Input::Sent { at, bytes } => {
                for &byte in bytes {
                    self.sent(byte, at);
                }
            }
            Input::Opened { at } => self.opened(at),
            Input::Tick { at } => self.tick(at),
            Input::End => {
                if let Some(estimator) = &mut self.estimator {
                    estimator.end(&mut self.events);
                }
            }
        }
        self.note_events();
        self.outputs.extend(self.events.drain(..).map(Output::Event));
    }

    /// The next output; drain to `None` before the next input.
    pub fn poll_output(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// When to hand in [`Input::Tick`], unless an input comes earlier.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.conversation.deadline()
    }

    /// The map as it is now.
    #[must_use]
    pub fn raster(&self) -> Raster {
        self.estimator.as_ref().map_or_else(Raster::default, |estimator| estimator.raster())
    }

    /// The ring, once known.
    #[must_use]
    pub fn ring(&self) -> Option<&Ring> {
        self.aligner.ring()
    }

    /// What the board's motors do, by its last MOTION; none before there was one.
    #[must_use]
    pub const fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// The last sweep, once the ring is known.
    #[must_use]
    pub fn sweep(&self) -> Option<&Sweep> {
        self.aligner.sweep()
    }

    /// Each sensor's state, by id.
    #[must_use]
    pub fn states(&self) -> &[SensorState] {
        self.estimator.as_ref().map_or(&[], |estimator| estimator.states())
    }

    /// The wheels as the estimator has learnt them; the paper's method learns none.
    #[must_use]
    pub fn calibration(&self) -> Option<Calibration> {
        self.estimator.as_ref()?.calibration()
    }

    /// Everything worth remembering; none before there is something, nor where a known map is not to be changed.
    #[must_use]
    pub fn saved_state(&self) -> Option<SavedState> {
        self.estimator.as_ref()?.saved_state()
    }

    /// Normalised innovation squared of the last sweep, per wall seen: 1 on the mean for a consistent filter. NaN where it saw no wall;
    /// the paper's method has none.
    #[must_use]
    pub fn nis(&self) -> f64 {
        self.estimator.as_ref().map_or(f64::NAN, |estimator| estimator.nis())
    }

    /// The board as far as it is known.
    #[must_use]
    pub fn board(&self) -> &Board {
        self.conversation.board()
    }

    /// What has been counted so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let decoded = self.decoder.counters();
        let (unwrapped_steps, refused_steps) = self.aligner.step_counts();
        Counters {
            unwrapped_steps,
            refused_steps,
            stray_texts: self.text.count(),
            refused_stamps: self.aligner.refused_stamps(),
            frames: decoded.frames,
            crc_errors: decoded.crc_errors,
            malformed: decoded.malformed,
            dropped_bytes: decoded.dropped_bytes,
            dropped_sweeps: self.aligner.dropped(),
            ..self.counters
        }
    }

    fn received(&mut self, byte: u8, at: Timestamp) {
        let frame = self.decoder.push(byte);
        let parsed = frame.map(|frame| (frame.seq, Message::parse(frame.kind, frame.payload)));
        let decoded = self.decoder.counters();
        if self.text.take(byte, decoded.frames, decoded.crc_errors + decoded.malformed) {
            self.trouble(Topic::Text, self.text.report(), at);
        }
        let Some((seq, message)) = parsed else { return };
        self.count_lost(seq);
        self.conversation.heard(at);
        match message {
            Ok(message) if message.kind() & FROM_HOST != 0 => self.counters.echoed += 1,
            Ok(message) => self.message(message, at),
            Err(MessageError::UnknownType(_)) => self.counters.unknown += 1,
            Err(error) => self.invalid(&error, at),
        }
        self.take_troubles(at);
    }

    fn message(&mut self, message: Message, at: Timestamp) {
        if let Message::Hello(hello) = message {
            return self.hello(hello, at);
        }
        if self.conversation.board().is_refused() {
            return;
        }
        let Self { conversation, aligner, estimator, kept_sweeps, counters, events, noted, .. } = self;
        let trust = match &message {
            Message::Sonar(Sonar { t_us, .. }) | Message::Encoder(Encoder { t_us, .. }) => {
                conversation.trust(at, || aligner.continues(*t_us, at))
            }
            _ => Trust::Yes,
        };
        let aligned = match &message {
            _ if trust == Trust::Restarted => Err(Restarted),
            _ if trust == Trust::Wait => Ok(()),
            Message::Sonar(sonar) => {
                conversation.fired(at);
                counters.groups += 1;
                aligner.sonar(sonar, at, |sweep| {
                    if let Some(kept) = kept_sweeps {
                        kept.push(sweep.clone());
                    }
                    noted.moves(sweep);
                    if let Some(estimator) = estimator {
                        estimator.update(sweep, events);
                        counters.sweeps += 1;
                    }
                })
            }
            Message::Encoder(encoder) => aligner.encoder(encoder, at),
            Message::TimeResponse { token, rx_us, tx_us } => match conversation.time_request(*token) {
                Some(sent) => aligner.round_trip(sent, *rx_us, *tx_us, at),
                None => Ok(()),
            },
            _ => return self.aside(&message, at),
        };
        if aligned == Err(Restarted) {
            self.restart(at);
        }
        self.turn_encoders();
    }

    /// Negates the counts of encoders that were found to run backwards.
    fn turn_encoders(&mut self) {
        let reversed = self.estimator.as_ref().map_or([false; 2], |estimator| estimator.reversed_encoders());
        for (wheel, (now, before)) in reversed.iter().zip(self.reversed).enumerate() {
            if *now != before {
                self.aligner.reverse_encoder(wheel);
            }
        }
        self.reversed = reversed;
    }

    fn hello(&mut self, hello: Hello, at: Timestamp) {
        if self.conversation.hello(hello, at, &mut self.events) {
            self.restart(at);
        }
        let ticks = self.conversation.board().ticks_per_turn();
        if let (Some(ticks), None) = (ticks, self.config.robot.ticks_per_turn) {
            self.use_ticks(ticks);
        }
    }

    fn opened(&mut self, at: Timestamp) {
        // Half a frame of the old connection must not eat the first of the new one.
        self.decoder.push(DELIMITER);
        self.conversation.opened(at);
        self.last_seq = None;
    }

    fn restart(&mut self, at: Timestamp) {
        self.aligner.restart();
        self.conversation.restarted(at);
        (self.last_seq, self.motion) = (None, None);
        self.counters.restarts += 1;
        self.events.push(Event::BoardReset { at });
    }

    fn use_ring(&mut self, ring: Ring, at: Timestamp) {
        if self.aligner.ring() == Some(&ring) {
            return;
        }
        self.estimator = (self.methods)(&self.config, &ring, &self.start, &self.params).ok();
        if let Start::Resume(memory) = &self.start {
            self.events.extend(memory.faults(at, ring.len()));
        }
        self.events.push(Event::Ring { at, sensors: ring.len() });
        self.note_small_ring(ring.len(), at);
        self.aligner.set_ring(ring);
    }

    fn use_ticks(&mut self, ticks_per_turn: u32) {
        let robot = &self.config.robot;
        let mean_m = TAU * robot.wheel_radius_m / f64::from(ticks_per_turn);
        let left_m = 2.0 * mean_m / (1.0 + robot.wheel_ratio);
        let metres_per_tick = [left_m, left_m * robot.wheel_ratio];
        self.aligner.set_wheels(Wheels { metres_per_tick, base_m: robot.wheel_base_m });
    }

    fn sent(&mut self, byte: u8, at: Timestamp) {
        let Some(frame) = self.sent.push(byte) else { return };
        if let Ok(Message::TimeRequest { token }) = Message::parse(frame.kind, frame.payload) {
            self.conversation.time_request_sent(token, at);
        }
    }

    fn tick(&mut self, at: Timestamp) {
        if at < self.conversation.deadline() {
            return;
        }
        self.note_silence(at);
        for message in self.conversation.ask(at, &mut self.events) {
            let frame = self.encoder.encode(&message);
            self.outputs.push_back(Output::Transmit(Bytes::copy_from_slice(&frame)));
        }
    }
}

/// The bit that marks the host's messages.
const FROM_HOST: u8 = 0x80;
