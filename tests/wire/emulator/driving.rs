//! The image's PWM pins move the simulated robot, and whatever ends a drive, it stands still in time.

use super::emulation::{self, Emulated, Host, Mishap};
use super::plant::Plant;
use slamd_core::Pose2;
use slamd_protocol::{Drive, FrameDecoder, FrameEncoder, Message, MotionState, Setting, WheelSpeeds};
use slamd_sim::random::{Random, Stream};

/// The wheels must stand this long after the board has a reason to stop, and after the last frame where the line is silent, microseconds.
const STANDSTILL_US: u64 = 150_000;
const SILENT_STANDSTILL_US: u64 = 400_000;
/// The watchdog ends a hang after this.
const WATCHDOG_US: u64 = 120_000;
/// The exchange with the emulated line waits this long, and a plant's step takes as long, microseconds.
const GRAIN_US: u64 = 4_000 + 5_000;
/// Period of DRIVE.
const DRIVE_US: u64 = 100_000;

/// How a drive ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ending {
    /// The line is cut.
    Silence,
    /// The last DRIVE expires while other frames come.
    Expiry,
    Stop,
    Zero,
    Reset,
    Emergency,
    /// The firmware stops with its interrupts off. The Mega's emulator has no such mishap.
    Hang,
}

const ENDINGS: [Ending; 7] =
    [Ending::Silence, Ending::Expiry, Ending::Stop, Ending::Zero, Ending::Reset, Ending::Emergency, Ending::Hang];

#[derive(Clone, Copy, Debug)]
enum Phase {
    /// HELLO, settings, START; then driving from this time on.
    Greeting(u64),
    /// Until this time, ended so.
    Driving(u64, Ending),
    /// Ended so at this time; the wheels must stand from this time on, until this one.
    Ended(Ending, u64, u64),
}

/// A host that drives at random speeds, and ends each drive at a random moment in another way.
struct Endings {
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    random: Random,
    phase: Phase,
    speeds: WheelSpeeds,
    ended: usize,
    /// How drives end on this board, in turn.
    endings: &'static [Ending],
    settings: Vec<(Setting, i32)>,
    mishap: Option<Mishap>,
    /// Longest time from the reason to the standstill, by ending.
    longest_us: [u64; ENDINGS.len()],
    /// The greatest speed seen while driving.
    fastest_m_s: f64,
    states: Vec<MotionState>,
}

impl Endings {
    fn new(seed: u64, endings: &'static [Ending], settings: &[(Setting, i32)]) -> Self {
        Self {
            encoder: FrameEncoder::new(),
            decoder: FrameDecoder::new(),
            random: Random::new(seed, Stream::Robot),
            phase: Phase::Greeting(100_000),
            speeds: WheelSpeeds::ZERO,
            ended: 0,
            endings,
            settings: settings.to_vec(),
            mishap: None,
            longest_us: [0; ENDINGS.len()],
            fastest_m_s: 0.0,
            states: Vec::new(),
        }
    }

    fn drive(&mut self, speeds: WheelSpeeds) -> Vec<u8> {
        self.encoder.encode(&Message::Drive(Drive::new(speeds, 300, Drive::FROM_SOCKET).unwrap())).to_vec()
    }

    /// What is said at the end of a drive, and from when on the wheels must stand.
    fn end(&mut self, at_us: u64, ending: Ending) -> (Vec<u8>, u64) {
        match ending {
            // The last DRIVE was at most its period ago.
            Ending::Silence => (Vec::new(), at_us + SILENT_STANDSTILL_US),
            Ending::Expiry => (Vec::new(), at_us + 300_000 + STANDSTILL_US),
            Ending::Stop => (self.encoder.encode(&Message::Stop).to_vec(), at_us + STANDSTILL_US),
            Ending::Zero => (self.drive(WheelSpeeds::ZERO), at_us + STANDSTILL_US),
            Ending::Reset => {
                self.mishap = Some(Mishap::Reset);
                (Vec::new(), at_us + STANDSTILL_US)
            }
            Ending::Hang => {
                self.mishap = Some(Mishap::Hang);
                (Vec::new(), at_us + WATCHDOG_US + STANDSTILL_US)
            }
            Ending::Emergency => (Vec::new(), at_us + STANDSTILL_US),
        }
    }
}

impl Host for Endings {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "random times and speeds")]
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            if let Ok(Message::Motion(motion)) = Message::parse(frame.kind, frame.payload)
                && self.states.last() != Some(&motion.state)
            {
                self.states.push(motion.state);
            }
        }
        match self.phase {
            Phase::Greeting(from_us) if at_us >= from_us => {
                let spin = self.random.uniform(150.0, 600.0) as i16;
                self.speeds = if self.random.sign() > 0.0 {
                    WheelSpeeds::new(spin, -spin).unwrap()
                } else {
                    WheelSpeeds::new(-spin, spin / 2).unwrap()
                };
                let until_us = from_us + 800_000 + self.random.uniform(0.0, 700_000.0) as u64;
                self.phase = Phase::Driving(until_us, self.endings[self.ended % self.endings.len()]);
                let set = |(key, value): &(Setting, i32)| Message::ConfigSet { key: key.key(), value: *value };
                let mut messages = vec![Message::HelloRequest { major: 1, minor: 1 }];
                messages.extend(self.settings.iter().map(set));
                messages.push(Message::Start);
                messages.iter().flat_map(|message| self.encoder.encode(message).to_vec()).collect()
            }
            Phase::Greeting(_) => Vec::new(),
            Phase::Driving(until_us, ending) if at_us >= until_us => {
                let (said, stands_us) = self.end(at_us, ending);
                self.phase = Phase::Ended(ending, at_us, stands_us);
                said
            }
            Phase::Driving(..) if at_us.is_multiple_of(DRIVE_US) => self.drive(self.speeds),
            Phase::Ended(Ending::Expiry, ended_us, _)
                if at_us.is_multiple_of(DRIVE_US) && at_us < ended_us + 600_000 =>
            {
                self.encoder.encode(&Message::Heartbeat).to_vec()
            }
            Phase::Ended(_, ended_us, _) if at_us >= ended_us + 1_000_000 => {
                self.ended += 1;
                self.phase = Phase::Greeting(at_us + 100_000);
                // A stall or an emergency is over.
                self.drive(WheelSpeeds::ZERO)
            }
            Phase::Driving(..) | Phase::Ended(..) => Vec::new(),
        }
    }

    fn truth(&mut self, _: u64, _: Pose2) {}

    fn look(&mut self, at_us: u64, plant: &Plant) {
        let fastest_m_s = plant.wheel_speeds_m_s().iter().fold(0.0, |fastest: f64, m_s| fastest.max(m_s.abs()));
        match self.phase {
            Phase::Driving(..) => self.fastest_m_s = self.fastest_m_s.max(fastest_m_s),
            Phase::Ended(ending, ended_us, stands_us) => {
                if fastest_m_s > 0.0 {
                    let longest = &mut self.longest_us[ending as usize];
                    *longest = (*longest).max(at_us - ended_us);
                    assert!(
                        at_us <= stands_us + GRAIN_US,
                        "{ending:?}: {fastest_m_s} m/s {} us after it",
                        at_us - ended_us
                    );
                }
            }
            Phase::Greeting(_) => {}
        }
    }

    fn emergency(&self) -> bool {
        matches!(self.phase, Phase::Ended(Ending::Emergency, ended_us, stands_us) if ended_us < stands_us)
    }

    fn mishap(&mut self) -> Option<Mishap> {
        self.mishap.take()
    }
}

const TOP_SPEED: (Setting, i32) = (Setting::TopSpeedMmS, 600);
/// A Pico has pins for motors with 8 sensors at most.
const PICO_SENSORS: u8 = 8;

#[test]
fn the_image_stands_still_in_time_whatever_ends_a_drive() {
    stands_still_in_time(emulation::mega(), &ENDINGS[..6], &[TOP_SPEED], 36);
}

#[test]
fn the_pico_stands_still_in_time_whatever_ends_a_drive() {
    let Some(pico) = emulation::pico(PICO_SENSORS) else { return };
    stands_still_in_time(&pico, &ENDINGS, &[(Setting::Sensors, PICO_SENSORS.into()), TOP_SPEED], 42);
}

fn stands_still_in_time(board: &Emulated, endings: &'static [Ending], settings: &[(Setting, i32)], seconds: u64) {
    let mut host = Endings::new(1, endings, settings);
    emulation::run_with(board, Plant::new(1, board.wiring).standing(), seconds, &mut host);
    println!(
        "{} endings, longest {:?} us for {ENDINGS:?}; fastest {} m/s",
        host.ended, host.longest_us, host.fastest_m_s
    );
    assert!(host.ended >= 2 * endings.len(), "{}", host.ended);
    assert!(host.fastest_m_s > 0.3, "it hardly moved: {} m/s", host.fastest_m_s);
    let all = [MotionState::Idle, MotionState::Driving, MotionState::TimeOut, MotionState::EmergencyPin];
    assert!(all.iter().all(|state| host.states.contains(state)), "{:?}", host.states);
}

/// Drives ahead without looking.
struct Ahead {
    settings: Vec<(Setting, i32)>,
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    last: Option<MotionState>,
    /// Looks since the first obstacle, and how many of them find the board stopped by it.
    looks: u32,
    blocked: u32,
    nearest_m: f64,
    fastest_m_s: f64,
}

impl Host for Ahead {
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            if let Ok(Message::Motion(motion)) = Message::parse(frame.kind, frame.payload) {
                self.last = Some(motion.state);
            }
        }
        let mut say = |message: &Message| self.encoder.encode(message).to_vec();
        match at_us {
            100_000 => {
                let set = |(key, value): &(Setting, i32)| Message::ConfigSet { key: key.key(), value: *value };
                self.settings.iter().flat_map(|setting| say(&set(setting))).collect()
            }
            200_000 => say(&Message::Start),
            _ if at_us > 500_000 && at_us.is_multiple_of(DRIVE_US) => {
                let ahead = WheelSpeeds::new(500, 500).unwrap();
                say(&Message::Drive(Drive::new(ahead, 300, Drive::FROM_SOCKET).unwrap()))
            }
            _ => Vec::new(),
        }
    }

    fn truth(&mut self, _: u64, _: Pose2) {}

    fn look(&mut self, _: u64, plant: &Plant) {
        let is_blocked = self.last == Some(MotionState::Obstacle);
        self.blocked += u32::from(is_blocked);
        self.looks += u32::from(is_blocked || self.blocked > 0);
        self.nearest_m = self.nearest_m.min(plant.clearance_m());
        let [left, right] = plant.wheel_speeds_m_s();
        self.fastest_m_s = self.fastest_m_s.max(0.5 * (left + right));
    }
}

#[test]
fn the_image_stops_before_a_wall_that_the_host_drives_at() {
    let last = stops_before_a_wall(emulation::mega(), &[TOP_SPEED]);
    assert_eq!(last, [Some(MotionState::Obstacle); 2]);
}

#[test]
fn the_pico_stops_before_a_wall_that_the_host_drives_at() {
    let Some(pico) = emulation::pico(PICO_SENSORS) else { return };
    stops_before_a_wall(&pico, &[(Setting::Sensors, PICO_SENSORS.into()), TOP_SPEED]);
}

/// What the board says at the end of each drive.
fn stops_before_a_wall(board: &Emulated, settings: &[(Setting, i32)]) -> [Option<MotionState>; 2] {
    use slamd_sim::robot::BODY_RADIUS_M;
    [1, 2].map(|seed| {
        let mut host = Ahead {
            settings: settings.to_vec(),
            encoder: FrameEncoder::new(),
            decoder: FrameDecoder::new(),
            last: None,
            looks: 0,
            blocked: 0,
            nearest_m: f64::INFINITY,
            fastest_m_s: 0.0,
        };
        emulation::run_with(board, Plant::new(seed, board.wiring).standing(), 15, &mut host);
        println!(
            "seed {seed}: {:.3} m from the body to the wall; blocked in {} of {} looks since it saw it",
            host.nearest_m - BODY_RADIUS_M,
            host.blocked,
            host.looks
        );
        // An echo that fails lets the robot creep for a cycle of the ring.
        assert!(host.blocked > 100 && 10 * host.blocked > 9 * host.looks, "{} of {}", host.blocked, host.looks);
        assert!(host.fastest_m_s > 0.3, "{} m/s", host.fastest_m_s);
        assert!(host.nearest_m > BODY_RADIUS_M + 0.02, "seed {seed}: {} m", host.nearest_m);
        host.last
    })
}
