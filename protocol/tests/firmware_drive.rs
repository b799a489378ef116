//! The firmware drives its motors as the protocol says, and stands still for each reason that the protocol gives.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod board;

use board::Script;
use slamd_protocol::{
    AckResult, Drive, Encoder, FrameEncoder, Hello, Message, Motion, MotionState, Setting, WheelSpeeds, encode_frame,
    kind,
};

/// All wheels must stand this long after the reason to stop, microseconds, and the host may be silent for so long.
const STANDSTILL_US: u32 = 150_000;
const SILENCE_US: u32 = 250_000;
/// A control step, and the period of ENCODER.
const STEP_US: u32 = 10_000 + 20_000;

/// A board with motors whose ring fires.
fn ready() -> Script {
    Script::boot(0).set(Setting::TopSpeedMmS, 800).say(&Message::Start).then("run 200000")
}

trait Driven {
    /// A DRIVE, and the 10 ms after it.
    fn drive(self, left_mm_s: i16, right_mm_s: i16, valid_ms: u16) -> Self;
    /// So many of them, 100 ms apart.
    fn drives(self, count: u32, left_mm_s: i16, right_mm_s: i16) -> Self;
}

impl Driven for Script {
    fn drive(self, left_mm_s: i16, right_mm_s: i16, valid_ms: u16) -> Self {
        let speeds = WheelSpeeds::new(left_mm_s, right_mm_s).unwrap();
        self.say(&Message::Drive(Drive::new(speeds, valid_ms, 0).unwrap()))
    }

    fn drives(mut self, count: u32, left_mm_s: i16, right_mm_s: i16) -> Self {
        for _ in 0..count {
            self = self.drive(left_mm_s, right_mm_s, 300).then("run 90000");
        }
        self
    }
}

fn motions(messages: &[Message]) -> Vec<Motion> {
    messages.iter().filter_map(|m| if let Message::Motion(motion) = m { Some(*motion) } else { None }).collect()
}

/// The states in order, each once.
fn states(messages: &[Message]) -> Vec<MotionState> {
    let mut states: Vec<MotionState> = motions(messages).iter().map(|motion| motion.state).collect();
    states.dedup();
    states
}

fn encoders(messages: &[Message]) -> Vec<Encoder> {
    messages.iter().filter_map(|m| if let Message::Encoder(encoder) = m { Some(*encoder) } else { None }).collect()
}

/// The last instant at which a wheel turned, microseconds of the board.
fn last_turn_us(messages: &[Message]) -> u32 {
    let encoders = encoders(messages);
    let counts = |encoder: &Encoder| (encoder.left_ticks, encoder.right_ticks);
    encoders.windows(2).rfind(|w| counts(&w[0]) != counts(&w[1])).map_or(0, |w| w[1].t_us)
}

fn results(messages: &[Message]) -> Vec<AckResult> {
    let of_drive = |m: &Message| match m {
        Message::Ack { of_type: kind::DRIVE, result, .. } => Some(*result),
        _ => None,
    };
    messages.iter().filter_map(of_drive).collect()
}

#[test]
fn it_says_that_it_drives_and_nothing_more_before_the_first_drive() {
    let messages = ready().then("run 2000000").messages();
    let hello = messages.iter().find_map(|m| if let Message::Hello(hello) = m { Some(hello) } else { None }).unwrap();
    assert!(hello.drives() && hello.capabilities == Hello::CAPABILITY_DRIVES);
    assert!(!Hello { minor: 0, ..*hello }.drives(), "a board of 1.0");
    assert_eq!(states(&messages), []);
    assert_eq!(last_turn_us(&messages), 0);
}

#[test]
fn the_wheels_follow_a_command_by_a_ramp_and_keep_the_curve() {
    let messages = ready().drives(20, 300, -150).messages();
    assert_eq!(states(&messages), [MotionState::Driving]);
    let motions = motions(&messages);
    let last = motions.last().unwrap();
    assert_eq!((last.commanded.left_mm_s(), last.commanded.right_mm_s()), (300, -150));
    assert!((285..=315).contains(&last.left_mm_s) && (-165..=-135).contains(&last.right_mm_s), "{last:?}");
    // 300 mm/s at 500 mm/s² take 0.6 s.
    let ramp = motions.iter().filter(|motion| motion.commanded.left_mm_s() < 300).count();
    assert!((4..=8).contains(&ramp), "{ramp}");
    let fast = ready().drives(30, 2_000, 1_000).messages();
    let last = self::motions(&fast).last().unwrap().commanded;
    assert_eq!((last.left_mm_s(), last.right_mm_s()), (800, 400), "both wheels are scaled");
}

#[test]
fn without_a_valid_drive_the_wheels_stand_in_time() {
    let begin_us = |script: &dyn Fn() -> Script| encoders(&script().messages()).last().unwrap().t_us;
    let driven = || ready().drives(10, 400, 400);
    let stops = |script: Script, at_us: u32| {
        let messages = script.then("run 2500000").messages();
        assert_eq!(states(&messages), [MotionState::Driving, MotionState::TimeOut]);
        let turned_us = last_turn_us(&messages);
        assert!(turned_us <= at_us + STANDSTILL_US + STEP_US, "{turned_us} after {at_us}");
        assert!(turned_us + STEP_US >= at_us, "it drove for as long as it might: {turned_us}, {at_us}");
    };
    let now_us = begin_us(&driven);
    stops(driven().drive(400, 400, 100), now_us + 100_000);
    stops(driven().drive(400, 400, 1_000), now_us + SILENCE_US);
    // The host is there, but commands nothing more.
    let with = |message: &Message| {
        (0..12).fold(driven().drive(400, 400, 500), |script, _| script.then("run 90000").say(message))
    };
    stops(with(&Message::Heartbeat), now_us + 500_000);
    stops(with(&Message::TimeRequest { token: 1 }), now_us + 500_000);
}

#[test]
fn stop_and_a_restart_end_driving() {
    for end in ["stop", "boot"] {
        let driven = ready().drives(10, 400, 400);
        let script = if end == "stop" { driven.say(&Message::Stop) } else { driven.then("boot 5000000") };
        // The ring fires again, but nobody commands.
        let messages = script.then("run 150000").say(&Message::Start).then("run 1000000").messages();
        let states = states(&messages);
        assert_eq!(states[0], MotionState::Driving, "{end}");
        let last = encoders(&messages);
        let since = last.iter().rev().take(40).collect::<Vec<_>>();
        assert!(since.iter().all(|encoder| encoder.left_ticks == since[0].left_ticks), "{end}: {since:?}");
    }
}

#[test]
fn a_drive_is_refused_where_the_ring_stands_where_it_is_out_of_range_and_without_motors() {
    let stopped = Script::boot(0).set(Setting::TopSpeedMmS, 800).drives(5, 300, 300).messages();
    assert_eq!(results(&stopped), [AckResult::Busy; 5]);
    // 2001 mm/s, and 49 ms.
    let bad = [[0xD1, 7, 0, 0, 200, 0, 1], [100, 0, 100, 0, 49, 0, 1]];
    let frames = bad.map(|payload| encode_frame(kind::DRIVE, 0, &payload.into_iter().collect()));
    let refused = ready().hear(&frames[0]).hear(&frames[1]).then("run 500000").messages();
    assert_eq!((results(&refused), last_turn_us(&refused)), (vec![AckResult::Refused; 2], 0));
    let without = Script::boot(0).say(&Message::Start).drives(10, 300, 300).messages();
    assert_eq!((states(&without), last_turn_us(&without)), (vec![MotionState::NoMotors], 0));
}

#[test]
fn an_obstacle_stops_the_way_there_and_no_other() {
    // 1000 us are 17 cm, ahead; sensor 16 looks back.
    let near = || ready().drives(10, 300, 300).then("sensor 0 1000").then("run 100000");
    let ahead = near().drives(10, 300, 300).messages();
    assert_eq!(states(&ahead), [MotionState::Driving, MotionState::Obstacle]);
    let stopped = encoders(&ahead);
    let standing =
        stopped.iter().rev().take(20).all(|encoder| encoder.left_ticks == stopped[stopped.len() - 1].left_ticks);
    assert!(standing);
    use MotionState::{Driving, Obstacle};
    assert_eq!(states(&near().drives(3, 300, 300).drives(5, -300, -300).messages()), [Driving, Obstacle, Driving]);
    assert_eq!(states(&near().drives(3, 300, 300).drives(5, -300, 300).messages()), [Driving, Obstacle, Driving]);
    let behind = ready().then("sensor 16 1000").then("run 200000").drives(5, 300, 300).drives(5, -300, -300);
    assert_eq!(states(&behind.messages()), [Driving, Obstacle]);
    // A wall beside the robot, seen by the sensors to its left, is passed by.
    let beside = ready().then("sensor 8 700\nsensor 7 720\nsensor 9 720").then("run 200000").drives(5, 300, 300);
    assert_eq!(states(&beside.messages()), [Driving]);
}

#[test]
fn it_does_not_drive_where_its_sensors_tell_nothing() {
    let blind = (0..5).chain(28..32).fold(ready(), |script, sensor| script.then(&format!("sensor {sensor} -1")));
    let messages = blind.then("run 300000").drives(5, 300, 300).drives(5, -300, -300).messages();
    assert_eq!(states(&messages), [MotionState::Obstacle, MotionState::Driving]);
    let one_is_broken = ready().then("sensor 0 -1").then("run 300000").drives(5, 300, 300);
    assert_eq!(states(&one_is_broken.messages()), [MotionState::Driving]);
}

#[test]
fn a_stalled_wheel_stops_both_until_the_command_is_zero() {
    use MotionState::{Driving, Idle, Stall};
    let stalled = || ready().drives(5, 300, 300).then("hold 1").drives(15, 300, 300);
    assert_eq!(states(&stalled().then("hold -1").drives(5, 300, 300).messages()), [Driving, Stall]);
    let freed = stalled().then("hold -1").drives(1, 0, 0).drives(5, 300, 300);
    assert_eq!(states(&freed.messages()), [Driving, Stall, Idle, Driving]);
    // A motor that runs the wrong way is one, too.
    let wrong = Script::boot(0).set(Setting::TopSpeedMmS, 800).set(Setting::LeftMotorReversed, 1).say(&Message::Start);
    assert_eq!(states(&wrong.then("run 200000").drives(15, 300, 300).messages()), [Driving, Stall]);
    // Slow wheels are none.
    assert_eq!(states(&ready().drives(30, 20, 20).messages()), [Driving]);
}

#[test]
fn the_emergency_pin_stops_until_it_is_closed_and_the_command_was_zero() {
    use MotionState::{Driving, EmergencyPin, Idle};
    let opened = || ready().drives(5, 300, 300).then("emergency 1").drives(3, 300, 300);
    assert_eq!(states(&opened().drives(2, 0, 0).drives(3, 300, 300).messages()), [Driving, EmergencyPin]);
    let closed = opened().then("emergency 0").drives(3, 300, 300);
    assert_eq!(states(&closed.messages()), [Driving, EmergencyPin]);
    let again = opened().then("emergency 0").drives(1, 0, 0).drives(3, 300, 300);
    assert_eq!(states(&again.messages()), [Driving, EmergencyPin, Idle, Driving]);
}

#[test]
fn no_noise_moves_a_wheel() {
    let mut state = 7_u32;
    let mut byte = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let frame =
        FrameEncoder::new().encode(&Message::Drive(Drive::new(WheelSpeeds::new(300, 300).unwrap(), 1_000, 0).unwrap()));
    let mut noise: Vec<u8> = (0..20_000).map(|_| byte()).collect();
    // Each DRIVE with one wrong byte.
    for at in 0..frame.len() - 1 {
        let mut damaged = frame.to_vec();
        damaged[at] ^= 1 + byte() % 255;
        noise.extend([0].iter().chain(&damaged));
    }
    let messages = ready().hear(&noise).then("run 1000000").messages();
    assert_eq!((states(&messages), last_turn_us(&messages)), (vec![], 0));
}

#[test]
fn settings_of_a_firmware_for_1_0_are_kept() {
    let mut settings: Vec<u8> = Setting::ALL[..12].iter().flat_map(|setting| setting.default().to_le_bytes()).collect();
    settings[..4].copy_from_slice(&16_i32.to_le_bytes());
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&settings);
    let store: Vec<u8> = [7, 0, 0, 0].into_iter().chain(settings).chain(sum.to_le_bytes()).collect();
    let hex: String = store.iter().map(|byte| format!("{byte:02x}")).collect();
    let script = Script::boot(0).then(&format!("store {} {hex}", store.len())).then("boot 0");
    let sensors = Message::ConfigValue { key: Setting::Sensors.key(), value: 16 };
    let top = Message::ConfigValue { key: Setting::TopSpeedMmS.key(), value: 0 };
    let get = |setting: Setting| Message::ConfigGet { key: setting.key() };
    let messages = script.say(&get(Setting::Sensors)).say(&get(Setting::TopSpeedMmS)).messages();
    assert!(messages.contains(&sensors) && messages.contains(&top), "{messages:?}");
}
