//! What a board tells of its motors: an event at each change, and what it must not say is counted and named.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{Config, Event, Input, Output, Pipeline, Start, Timestamp};
use slamd_protocol::{FrameEncoder, Hello, Message, Motion, MotionState, Text, WheelSpeeds, encode_frame, kind};

/// The events of these frames, 10 ms apart.
fn events(pipeline: &mut Pipeline, frames: &[Vec<u8>]) -> Vec<Event> {
    let mut events = Vec::new();
    for (number, bytes) in (0..).zip(frames) {
        pipeline.handle(Input::Received { at: Timestamp::from_us(10_000 * number), bytes });
        while let Some(output) = pipeline.poll_output() {
            if let Output::Event(event) = output {
                events.push(event);
            }
        }
    }
    events
}

fn motion(encoder: &mut FrameEncoder, state: MotionState) -> Vec<u8> {
    let commanded = WheelSpeeds::new(200, -200).unwrap();
    let motion = Motion { t_us: 1, state, commanded, left_mm_s: 190, right_mm_s: -190 };
    encoder.encode(&Message::Motion(motion)).to_vec()
}

fn hello(minor: u8, capabilities: u32) -> Hello {
    Hello {
        major: 1,
        minor,
        boot_id: 7,
        tick_hz: 1_000_000,
        sensors: 8,
        ticks_per_turn: 1_440,
        capabilities,
        config_crc: 0,
        uid: [0; 8],
        board: Text::new("board"),
        firmware: Text::new("1"),
    }
}

#[test]
fn each_change_of_the_motors_is_an_event() {
    use MotionState::{Driving, Obstacle};
    let mut pipeline = Pipeline::new(&Config::default(), Start::Fresh).unwrap();
    assert!(pipeline.motion().is_none());
    let mut encoder = FrameEncoder::new();
    let frames = [Driving, Driving, Obstacle, Obstacle, Driving].map(|state| motion(&mut encoder, state));
    let states: Vec<MotionState> = events(&mut pipeline, &frames)
        .iter()
        .filter_map(|event| if let Event::Motion { state, .. } = event { Some(*state) } else { None })
        .collect();
    assert_eq!(states, [Driving, Obstacle, Driving]);
    assert_eq!(pipeline.motion().map(|motion| motion.left_mm_s), Some(190));
}

#[test]
fn a_state_or_a_speed_that_cannot_be_is_counted_and_named() {
    let mut pipeline = Pipeline::new(&Config::default(), Start::Fresh).unwrap();
    let unknown_state = [&[1, 0, 0, 0, 7], &[0; 8][..]].concat();
    let too_fast = [&[1, 0, 0, 0, 1, 0xD1, 7], &[0; 6][..]].concat();
    let frames = [unknown_state, too_fast].map(|payload| {
        let payload = payload.into_iter().collect();
        encode_frame(kind::MOTION, 0, &payload).to_vec()
    });
    let events = events(&mut pipeline, &frames);
    let texts: Vec<&str> = events
        .iter()
        .filter_map(|event| if let Event::BoardTrouble { text, .. } = event { Some(&**text) } else { None })
        .collect();
    assert!(texts.len() == 2 && texts[0].contains("state of MOTION is 7") && texts[1].contains("is 2001"), "{texts:?}");
    assert_eq!((pipeline.counters().refused, pipeline.motion().is_none()), (2, true));
}

#[test]
fn only_a_board_of_1_1_with_the_bit_drives() {
    let drives = |minor, capabilities| hello(minor, capabilities).drives();
    // A board of 1.0 may have any bits: none had a meaning.
    assert!(drives(1, 1) && drives(2, 3));
    assert!(!drives(0, 1) && !drives(0, u32::MAX) && !drives(1, 0) && !drives(1, 2));
}
