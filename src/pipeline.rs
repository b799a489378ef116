//! The whole method, in order.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`
//!
//! A pipeline is a state machine without a clock, a file or a thread: [`Pipeline::handle`] takes what was read, what was
//! written and which deadline has come; [`Pipeline::poll_output`] gives what to write and what has happened. Drain it before
//! the next input. The same inputs give the same outputs, so a recorded session replays bit for bit.
//!
//! The steps from the sweep on are those of the chosen method: [`crate::walls`] or [`crate::paper`].

use crate::align::track::Wheels;
use crate::align::{Aligner, Restarted};
use crate::board::Board;
use crate::config::{Config, Method};
use crate::event::{Calibration, Counters, Event, Input, Output, SensorState};
use crate::geometry::Ring;
use crate::handshake::{Handshake, Known};
use crate::mapping::raster::Raster;
use crate::paper::Paper;
use crate::sweep::Sweep;
use crate::time::Timestamp;
use crate::walls::Walls;
use bytes::Bytes;
use slamd_protocol::{FrameDecoder, FrameEncoder, Hello, Message, MessageError};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// From the board's bytes to the robot's map.
#[derive(Debug)]
pub struct Pipeline {
    config: Config,
    decoder: FrameDecoder,
    sent: FrameDecoder,
    encoder: FrameEncoder,
    handshake: Handshake,
    board: Board,
    is_streaming: bool,
    aligner: Aligner,
    estimator: Option<Estimator>,
    last_seq: Option<u8>,
    counters: Counters,
    events: Vec<Event>,
    outputs: VecDeque<Output>,
}

/// The chosen method at work.
#[derive(Debug)]
enum Estimator {
    Walls(Box<Walls>),
    Paper(Box<Paper>),
}

impl Estimator {
    fn new(config: &Config, ring: &Ring) -> Self {
        match config.method {
            Method::Walls => Self::Walls(Box::new(Walls::new(config, ring))),
            Method::Paper => Self::Paper(Box::new(Paper::new(config, ring))),
        }
    }

    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        match self {
            Self::Walls(walls) => walls.update(sweep, events),
            Self::Paper(paper) => paper.update(sweep, events),
        }
    }
}

impl Pipeline {
    /// A pipeline that has heard nothing yet.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let ring = &config.ring;
        let mut pipeline = Self {
            config: config.clone(),
            decoder: FrameDecoder::new(),
            sent: FrameDecoder::new(),
            encoder: FrameEncoder::default(),
            handshake: Handshake::default(),
            board: Board::default(),
            is_streaming: false,
            aligner: Aligner::new(ring.min_range_m..=ring.max_range_m, ring.temperature_c),
            estimator: None,
            last_seq: None,
            counters: Counters::default(),
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
            Input::Tick { at } => self.tick(at),
        }
    }

    /// The next output; drain to `None` before the next input.
    pub fn poll_output(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// When to hand in [`Input::Tick`], unless an input comes earlier.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.handshake.deadline()
    }

    /// The map as it is now.
    #[must_use]
    pub fn raster(&self) -> Raster {
        match &self.estimator {
            Some(Estimator::Walls(walls)) => walls.raster(),
            Some(Estimator::Paper(paper)) => paper.raster(),
            None => Raster::default(),
        }
    }

    /// The ring, once known.
    #[must_use]
    pub fn ring(&self) -> Option<&Ring> {
        self.aligner.ring()
    }

    /// Each sensor's state, by id.
    #[must_use]
    pub fn states(&self) -> &[SensorState] {
        match &self.estimator {
            Some(Estimator::Walls(walls)) => walls.states(),
            Some(Estimator::Paper(paper)) => paper.states(),
            None => &[],
        }
    }

    /// The wheels as the estimator has learnt them; the paper's method learns none.
    #[must_use]
    pub fn calibration(&self) -> Option<Calibration> {
        match &self.estimator {
            Some(Estimator::Walls(walls)) => Some(walls.calibration()),
            _ => None,
        }
    }

    /// What has been counted so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let decoded = self.decoder.counters();
        Counters {
            frames: decoded.frames,
            crc_errors: decoded.crc_errors,
            malformed: decoded.malformed,
            dropped_bytes: decoded.dropped_bytes,
            dropped_sweeps: self.aligner.dropped(),
            ..self.counters
        }
    }

    fn received(&mut self, byte: u8, at: Timestamp) {
        let Some(frame) = self.decoder.push(byte) else { return };
        let (seq, message) = (frame.seq, Message::parse(frame.kind, frame.payload));
        if let Some(last) = self.last_seq.replace(seq) {
            self.counters.lost_frames += u64::from(seq.wrapping_sub(last).wrapping_sub(1));
        }
        self.handshake.heard(at);
        match message {
            Ok(message) => self.message(message, at),
            Err(MessageError::UnknownType(_)) => self.counters.unknown += 1,
            Err(_) => self.counters.refused += 1,
        }
        self.outputs.extend(self.events.drain(..).map(Output::Event));
    }

    fn message(&mut self, message: Message, at: Timestamp) {
        if let Message::Hello(hello) = message {
            return self.hello(hello, at);
        }
        if self.board.is_refused() {
            return;
        }
        let aligned = match &message {
            Message::Sonar(sonar) => {
                self.is_streaming = true;
                let Self { aligner, estimator, counters, events, .. } = self;
                aligner.sonar(sonar, at, |sweep| {
                    if let Some(estimator) = estimator {
                        estimator.update(sweep, events);
                        counters.sweeps += 1;
                    }
                })
            }
            Message::Encoder(encoder) => self.aligner.encoder(encoder, at),
            Message::TimeResponse { token, rx_us, tx_us } => match self.handshake.time_request(*token) {
                Some(sent) => self.aligner.round_trip(sent, *rx_us, *tx_us, at),
                None => Ok(()),
            },
            Message::Geometry(geometry) => {
                if let Some(ring) = self.board.place(geometry) {
                    self.use_ring(self.config.ring.ring().unwrap_or(ring), at);
                    self.handshake.hurry(at);
                }
                Ok(())
            }
            Message::Status(status) => {
                if let Some(temperature_cdeg) = status.temperature_cdeg {
                    self.aligner.set_temperature(0.01 * f64::from(temperature_cdeg));
                }
                Ok(())
            }
            Message::Log(log) => {
                let text = log.text.chars().filter(|c| !c.is_control()).collect();
                self.events.push(Event::BoardLog { at, text });
                Ok(())
            }
            _ => Ok(()),
        };
        if aligned == Err(Restarted) {
            self.restart(at);
        }
    }

    fn hello(&mut self, hello: Hello, at: Timestamp) {
        let ticks = hello.ticks_per_turn;
        let is_first = self.board.hello().is_none();
        if self.board.greet(hello) {
            self.restart(at);
        }
        let compatible = !self.board.is_refused();
        if is_first || !compatible {
            self.events.push(Event::Board { at, description: self.board.description(), compatible });
        }
        if compatible && self.config.robot.ticks_per_turn.is_none() && ticks > 0 {
            self.use_ticks(ticks);
        }
        self.handshake.hurry(at);
    }

    fn restart(&mut self, at: Timestamp) {
        self.aligner.restart();
        self.is_streaming = false;
        self.last_seq = None;
        self.handshake.hurry(at);
        self.events.push(Event::BoardReset { at });
    }

    fn use_ring(&mut self, ring: Ring, at: Timestamp) {
        if self.aligner.ring() == Some(&ring) {
            return;
        }
        self.estimator = Some(Estimator::new(&self.config, &ring));
        self.events.push(Event::Ring { at, sensors: ring.len() });
        self.aligner.set_ring(ring);
    }

    fn use_ticks(&mut self, ticks_per_turn: u32) {
        let robot = &self.config.robot;
        let metres_per_tick = TAU * robot.wheel_radius_m / f64::from(ticks_per_turn);
        self.aligner.set_wheels(Wheels { metres_per_tick, base_m: robot.wheel_base_m });
    }

    fn sent(&mut self, byte: u8, at: Timestamp) {
        let Some(frame) = self.sent.push(byte) else { return };
        if let Ok(Message::TimeRequest { token }) = Message::parse(frame.kind, frame.payload) {
            self.handshake.time_request_sent(token, at);
        }
    }

    fn tick(&mut self, at: Timestamp) {
        if at < self.handshake.deadline() {
            return;
        }
        let known = Known {
            hello: self.board.hello().is_some(),
            ring: self.aligner.ring().is_some(),
            streaming: self.is_streaming,
            refused: self.board.is_refused(),
        };
        for message in self.handshake.ask(at, known) {
            let frame = self.encoder.encode(&message);
            self.outputs.push_back(Output::Transmit(Bytes::copy_from_slice(&frame)));
        }
    }
}
