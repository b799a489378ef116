//! The pipeline and a simulated board in virtual time: hello, settings, restarts, reopened ports, boards that tell nonsense.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_capture::Record;
use slamd_core::{Config, Event, Input, Output, Pipeline, Pose2, Timestamp};
use slamd_protocol::{FrameDecoder, FrameEncoder, Hello, Message, Setting, Text};
use slamd_sim::board::Board;
use slamd_sim::fault::FaultMix;
use slamd_sim::link::LinkFaults;
use slamd_sim::simulation::{SimConfig, Simulation};
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;

/// A pipeline joined to a simulated board by bytes alone.
struct Rig {
    simulation: Simulation,
    pipeline: Pipeline,
    now_us: u64,
    /// The cable is in.
    joined: bool,
    events: Vec<Event>,
    sent: Vec<Message>,
    truth: Pose2,
    decoder: FrameDecoder,
}

const STEP_US: u64 = 5_000;

impl Rig {
    fn new(seed: u64, config: &Config) -> Self {
        let simulation = Simulation::new(SimConfig {
            world: World::named("flat").unwrap(),
            seed,
            duration_s: 600.0,
            mix: FaultMix::None,
            faults: Vec::new(),
            beam: BeamShape::Cone,
            sensors: 32,
            odometry_errors: 1.0,
            clock_drift_ppm: 500.0,
            link: LinkFaults::default(),
        });
        Self {
            simulation,
            pipeline: slamd_paper::pipeline(config, slamd_core::Start::Fresh).unwrap(),
            now_us: 0,
            joined: true,
            events: Vec::new(),
            sent: Vec::new(),
            truth: Pose2::default(),
            decoder: FrameDecoder::new(),
        }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some seconds")]
    fn run_s(&mut self, seconds: f64) {
        let end_us = self.now_us + (seconds * 1e6) as u64;
        while self.now_us < end_us {
            self.now_us += STEP_US;
            let now = Timestamp::from_us(self.now_us);
            while let Some(record) = self.simulation.poll(now) {
                match record {
                    Record::Received { bytes, .. } if self.joined => {
                        self.input(Input::Received { at: now, bytes: &bytes });
                    }
                    Record::Truth { pose, .. } => self.truth = pose,
                    _ => {}
                }
            }
            while self.pipeline.next_deadline() <= now {
                self.input(Input::Tick { at: self.pipeline.next_deadline().max(now) });
            }
        }
    }

    fn input(&mut self, input: Input<'_>) {
        self.pipeline.handle(input);
        let now = Timestamp::from_us(self.now_us);
        while let Some(output) = self.pipeline.poll_output() {
            match output {
                Output::Event(event) => self.events.push(event),
                Output::Transmit(frame) if self.joined => {
                    for &byte in &frame {
                        let message = self.decoder.push(byte).map(|frame| Message::parse(frame.kind, frame.payload));
                        self.sent.extend(message.map(Result::unwrap));
                    }
                    self.simulation.hear(now, &frame);
                    self.pipeline.handle(Input::Sent { at: now, bytes: &frame });
                }
                Output::Transmit(_) => {}
            }
        }
    }

    fn open(&mut self) {
        self.joined = true;
        self.input(Input::Opened { at: Timestamp::from_us(self.now_us) });
    }

    fn sweeps(&self) -> u64 {
        self.pipeline.counters().sweeps
    }

    fn last_pose(&self) -> Pose2 {
        let pose = self.events.iter().rev().find_map(|event| match event {
            Event::Estimate(estimate) => Some(estimate.pose),
            _ => None,
        });
        pose.unwrap()
    }

    /// `map_from_world`: constant, as long as the estimate is right.
    fn map_from_world(&self) -> Pose2 {
        self.last_pose() * self.truth.inverse()
    }

    fn poses_m(&self) -> Vec<Pose2> {
        let poses = self.events.iter().filter_map(|event| match event {
            Event::Estimate(estimate) => Some(estimate.pose),
            _ => None,
        });
        poses.collect()
    }

    fn assert_no_jump(&self, before: usize) {
        for pair in self.poses_m()[before..].windows(2) {
            let step_m = (pair[1].position() - pair[0].position()).norm();
            assert!(step_m < 0.15, "the pose jumped by {step_m} m");
        }
    }
}

#[test]
fn a_board_that_restarts_in_mid_stream_costs_no_pose() {
    let mut rig = Rig::new(3, &Config::default());
    rig.run_s(30.0);
    let before = rig.poses_m().len();
    let map_from_world = rig.map_from_world();
    assert!(before > 200, "{before} poses in 30 s");
    for restarts in 1..=3 {
        rig.simulation.restart_board();
        rig.run_s(10.0);
        assert_eq!(rig.pipeline.counters().restarts, restarts);
    }
    assert!(rig.poses_m().len() > before + 250, "the sweeps did not come back");
    rig.assert_no_jump(before - 1);
    let drift_m = (rig.map_from_world().position() - map_from_world.position()).norm();
    assert!(drift_m < 0.3, "{drift_m} m off after three restarts");
}

#[test]
fn a_cable_that_was_out_costs_no_pose_whether_or_not_the_board_restarted() {
    for restarts in [false, true] {
        let mut rig = Rig::new(4, &Config::default());
        rig.run_s(30.0);
        let (before, sweeps) = (rig.poses_m().len(), rig.sweeps());
        rig.joined = false;
        rig.run_s(0.4);
        if restarts {
            rig.simulation.restart_board();
        }
        rig.run_s(0.4);
        rig.open();
        let opened_us = rig.now_us;
        while rig.sweeps() == sweeps {
            rig.run_s(0.02);
            assert!(rig.now_us < opened_us + 3_500_000, "no sweep 3.5 s after the port was opened");
        }
        let within_ms = (rig.now_us - opened_us) / 1000;
        // A board that keeps sending is used at once; one that waits for the host may be addressed after 2.5 s.
        assert!(within_ms < if restarts { 3_000 } else { 300 }, "{within_ms} ms, restarts: {restarts}");
        rig.run_s(10.0);
        assert_eq!(rig.pipeline.counters().restarts, u64::from(restarts));
        for pair in rig.poses_m()[before - 1..].windows(2) {
            let step_m = (pair[1].position() - pair[0].position()).norm();
            assert!(step_m < 0.6, "the pose jumped by {step_m} m, restarts: {restarts}");
        }
    }
}

#[test]
fn the_boards_settings_are_brought_in_line() {
    let config = Config::from_toml("[board]\nleft_reversed = true\nslot_us = 30000\ngroups = 4\n").unwrap();
    let mut rig = Rig::new(5, &config);
    rig.run_s(5.0);
    let sets: Vec<&Message> = rig.sent.iter().filter(|message| matches!(message, Message::ConfigSet { .. })).collect();
    // What is as wanted is not written; the simulated ring is built as it is and refuses another slot.
    assert_eq!(
        sets,
        [
            &Message::ConfigSet { key: Setting::LeftReversed.key(), value: 1 },
            &Message::ConfigSet { key: Setting::SlotUs.key(), value: 30_000 }
        ]
    );
    let troubles: Vec<&Event> = rig.events.iter().filter(|event| matches!(event, Event::BoardTrouble { .. })).collect();
    assert!(matches!(troubles[..], [Event::BoardTrouble { text, .. }] if text.contains("board.slot_us = 30000")));
    let told = rig.sent.iter().filter(|message| **message == Message::ConfigGet { key: Setting::LeftReversed.key() });
    assert_eq!(told.count(), 2, "the value is asked for before and after it is set");
    assert!(rig.sweeps() > 10, "the ring fires all the same");
}

fn hello() -> Hello {
    Hello {
        major: slamd_protocol::VERSION_MAJOR,
        minor: 0,
        boot_id: 1,
        tick_hz: 1_000_000,
        sensors: 32,
        ticks_per_turn: 1440,
        capabilities: 0,
        config_crc: 0,
        uid: [0; 8],
        board: Text::new("test"),
        firmware: Text::new("1"),
    }
}

/// What a pipeline says after HELLO.
fn told(hello: Hello) -> Vec<Event> {
    let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    let frame = FrameEncoder::default().encode(&Message::Hello(hello));
    pipeline.handle(Input::Received { at: Timestamp::from_us(1000), bytes: &frame });
    let outputs = std::iter::from_fn(|| pipeline.poll_output());
    outputs
        .filter_map(|output| match output {
            Output::Event(event) => Some(event),
            Output::Transmit(_) => None,
        })
        .collect()
}

#[test]
fn what_a_board_says_of_itself_must_be_possible() {
    for (odd, words) in [
        (Hello { sensors: 0, ..hello() }, "0 sensors"),
        (Hello { sensors: 200, ..hello() }, "200 sensors"),
        (Hello { ticks_per_turn: 4_000_000_000, ..hello() }, "set robot.ticks_per_turn"),
    ] {
        let events = told(odd);
        assert!(matches!(&events[..], [Event::BoardTrouble { text, .. }] if text.contains(words)), "{events:?}");
    }
    assert!(matches!(&told(hello())[..], [Event::Board { compatible: true, .. }]));
}

#[test]
fn another_major_version_says_which_side_to_update() {
    let older = told(Hello { major: 0, ..hello() });
    assert!(
        matches!(&older[..], [Event::Board { compatible: false, description, .. }] if description.contains("update the board's firmware")),
        "{older:?}"
    );
    let newer = told(Hello { major: 2, ..hello() });
    assert!(
        matches!(&newer[..], [Event::Board { compatible: false, description, .. }] if description.contains("update slamd")),
        "{newer:?}"
    );
}

#[test]
fn the_simulated_board_acknowledges() {
    let ring = slamd_core::Ring::circle(8, 0.1, 0.2, 4);
    let random = slamd_sim::random::Random::new(1, slamd_sim::random::Stream::Board);
    let mut board = Board::new(ring, 0.0, random);
    let mut encoder = FrameEncoder::default();
    let mut ask = |message: Message| {
        let answers = board.hear(Timestamp::default(), &encoder.encode(&message));
        assert_eq!(answers.len(), 1, "{message:?}");
        let mut decoder = FrameDecoder::new();
        let answers = answers[0].iter().filter_map(|&byte| {
            let frame = decoder.push(byte)?;
            Some(Message::parse(frame.kind, frame.payload).unwrap())
        });
        answers.last().unwrap()
    };
    assert!(matches!(ask(Message::Start), Message::Ack { of_type: 0x82, result: slamd_protocol::AckResult::Done, .. }));
    assert!(matches!(
        ask(Message::ConfigGet { key: 200 }),
        Message::Ack { of_type: 0x85, result: slamd_protocol::AckResult::Unknown, .. }
    ));
    assert_eq!(ask(Message::ConfigGet { key: 1 }), Message::ConfigValue { key: 1, value: 8 });
}
