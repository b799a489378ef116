//! The Raspberry Pi Pico: what the Mega is held to, its grain of time, and its settings in the flash.

use super::emulation::{self, Host, Mishap};
use super::plant::Plant;
use super::{MACHINE, compare_in_lock_step, over_the_wire, sends_the_golden_capture};
use slamd_core::Pose2;
use slamd_protocol::{AckResult, Drive, Echo, FrameDecoder, FrameEncoder, Message, MotionState, Setting, WheelSpeeds};
use slamd_sim::random::{Random, Stream};

/// Its echo pins.
const SENSORS: u8 = 16;
/// So many and fewer leave pins for motors.
const SENSORS_WITH_MOTORS: u8 = 8;
/// Drives in lock-step, of `DRIVE_S` each: as many as CI has time for, because JavaScript emulates slowly. The Mega has more.
const DRIVES: u64 = 4;
/// How long the drive in real time takes.
const WIRE_S: u64 = 40;
/// The firmware promises that a time of flight is this exact, microseconds.
const GRAIN_US: u64 = 10;
/// How much of the first drive is golden.
const GOLDEN_S: u64 = 30;

#[test]
fn the_emulated_pico_maps_like_the_simulators_board() {
    let Some(board) = emulation::pico(SENSORS) else { return };
    let _machine = MACHINE.lock();
    compare_in_lock_step(&board, DRIVES);
}

/// The comparison with as many drives as the Mega's.
#[test]
#[ignore = "four minutes on two cores: cargo test --test wire pico -- --ignored"]
fn the_emulated_pico_maps_like_the_simulators_board_in_many_drives() {
    let Some(board) = emulation::pico(SENSORS) else { return };
    let _machine = MACHINE.lock();
    compare_in_lock_step(&board, super::LOCK_STEP_DRIVES);
}

#[test]
fn the_pico_maps_through_the_real_program() {
    let Some(board) = emulation::pico(SENSORS) else { return };
    let _machine = MACHINE.lock();
    let wire = over_the_wire(&board, 1, WIRE_S);
    println!("over the wire: {wire:?}");
    assert!(wire.ate_m <= 0.15, "{} m", wire.ate_m);
}

#[test]
fn the_pico_sends_the_golden_capture_to_the_bit() {
    let Some(board) = emulation::pico(SENSORS) else { return };
    let _machine = MACHINE.lock();
    let bytes = sends_the_golden_capture(&board, "flat-emulated-pico.mcap", "RP2040", GOLDEN_S);
    assert!(bytes > 50_000, "{bytes} bytes");
}

/// Compares times of flight with the pulses that the sonars made.
struct Grain {
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    heard: Vec<(u8, u64)>,
    compared: usize,
    worst_us: u64,
}

impl Host for Grain {
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            let Ok(Message::Sonar(sonar)) = Message::parse(frame.kind, frame.payload) else { continue };
            for echo in &sonar.echoes {
                if let Echo::Flight { us } = echo.echo {
                    self.heard.push((echo.sensor, us.into()));
                }
            }
        }
        if at_us == 100_000 { self.encoder.encode(&Message::Start).to_vec() } else { Vec::new() }
    }

    fn truth(&mut self, _: u64, _: Pose2) {}

    fn look(&mut self, _: u64, plant: &Plant) {
        for (sensor, us) in self.heard.drain(..) {
            self.worst_us = self.worst_us.max(us.abs_diff(plant.pulses_us[usize::from(sensor)]));
            self.compared += 1;
        }
    }
}

#[test]
fn the_picos_times_of_flight_are_exact_to_microseconds() {
    let Some(board) = emulation::pico(SENSORS) else { return };
    let mut host = Grain {
        encoder: FrameEncoder::new(),
        decoder: FrameDecoder::new(),
        heard: Vec::new(),
        compared: 0,
        worst_us: 0,
    };
    emulation::run(&board, 1, 20, &mut host);
    println!("{} times of flight, at most {} us wrong", host.compared, host.worst_us);
    assert!(host.compared > 1000, "{}", host.compared);
    assert!(host.worst_us <= GRAIN_US, "{} us", host.worst_us);
}

/// The firmware waits this long after the last change, and then for the flash: 45 ms to erase, 1 ms to write.
const KEPT_US: u64 = 200_000;

/// Changes a setting, cuts the power at a random time after that, and asks for the setting.
struct Settings {
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    random: Random,
    /// What the board may say: the value before the last change, and that after it.
    may_be: [i32; 2],
    changed_us: u64,
    cut_us: u64,
    cut: bool,
    asked: bool,
    rounds: usize,
    lost: usize,
    boot_ids: Vec<u32>,
}

impl Settings {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "random times and settings")]
    fn change(&mut self, at_us: u64) -> Vec<u8> {
        let value = self.random.uniform(20.0, 2000.0) as i32;
        self.may_be = [self.may_be[1], value];
        self.changed_us = at_us;
        self.cut_us = at_us + 8_000 + 4_000 * (self.random.uniform(0.0, 60.0) as u64);
        self.asked = false;
        self.encoder.encode(&Message::ConfigSet { key: Setting::RingRadiusMm.key(), value }).to_vec()
    }
}

impl Host for Settings {
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            match Message::parse(frame.kind, frame.payload) {
                Ok(Message::Hello(hello)) if self.boot_ids.last() != Some(&hello.boot_id) => {
                    self.boot_ids.push(hello.boot_id);
                }
                Ok(Message::ConfigValue { value, .. }) => {
                    let was_kept = self.cut_us >= self.changed_us + KEPT_US;
                    assert!(
                        value == self.may_be[1] || (value == self.may_be[0] && !was_kept),
                        "{value} mm instead of {:?}, cut after {} us",
                        self.may_be,
                        self.cut_us - self.changed_us
                    );
                    self.lost += usize::from(value != self.may_be[1]);
                    self.may_be[1] = value;
                    self.rounds += 1;
                    return self.change(at_us);
                }
                _ => {}
            }
        }
        if at_us == 100_000 {
            return self.change(at_us);
        }
        if self.cut_us > 0 && at_us >= self.cut_us + 60_000 && !self.asked {
            self.asked = true;
            return self.encoder.encode(&Message::ConfigGet { key: Setting::RingRadiusMm.key() }).to_vec();
        }
        Vec::new()
    }

    fn truth(&mut self, _: u64, _: Pose2) {}

    fn look(&mut self, at_us: u64, _: &Plant) {
        if at_us == self.cut_us {
            self.cut = true;
        }
    }

    fn mishap(&mut self) -> Option<Mishap> {
        std::mem::take(&mut self.cut).then_some(Mishap::Reset)
    }
}

#[test]
fn the_picos_settings_survive_power_cuts_at_any_time() {
    let Some(board) = emulation::pico(SENSORS) else { return };
    let mut host = Settings {
        encoder: FrameEncoder::new(),
        decoder: FrameDecoder::new(),
        random: Random::new(1, Stream::Robot),
        may_be: [150; 2],
        changed_us: 0,
        cut_us: 0,
        cut: false,
        asked: false,
        rounds: 0,
        lost: 0,
        boot_ids: Vec::new(),
    };
    emulation::run(&board, 1, 25, &mut host);
    println!("{} power cuts, {} before the setting was written; boots {:?}", host.rounds, host.lost, host.boot_ids);
    // Both sectors are used twice, and the cut comes before, while and after a copy is written.
    assert!(host.rounds > 70, "{}", host.rounds);
    assert!(host.lost > 5 && host.lost < host.rounds / 2, "{}", host.lost);
}

/// Says one message after the other, 40 ms apart, and notes what the board answers.
struct Questions {
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    questions: Vec<Message>,
    results: Vec<AckResult>,
    drives: Vec<bool>,
    states: Vec<MotionState>,
}

impl Host for Questions {
    fn exchange(&mut self, at_us: u64, bytes: &[u8]) -> Vec<u8> {
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            match Message::parse(frame.kind, frame.payload) {
                Ok(Message::Hello(hello)) => self.drives.push(hello.drives()),
                Ok(Message::Ack { result, .. }) => self.results.push(result),
                Ok(Message::Motion(motion)) => self.states.push(motion.state),
                _ => {}
            }
        }
        let is_due = at_us >= 100_000 && at_us.is_multiple_of(40_000) && !self.questions.is_empty();
        if is_due { self.encoder.encode(&self.questions.remove(0)).to_vec() } else { Vec::new() }
    }

    fn truth(&mut self, _: u64, _: Pose2) {}
}

#[test]
fn the_pico_has_motors_with_eight_sensors_only() {
    let Some(board) = emulation::pico(SENSORS_WITH_MOTORS) else { return };
    let set = |setting: Setting, value| Message::ConfigSet { key: setting.key(), value };
    let hello = Message::HelloRequest { major: 1, minor: 1 };
    let drive = Message::Drive(Drive::new(WheelSpeeds::ZERO, 300, Drive::FROM_SOCKET).unwrap());
    let questions = vec![
        set(Setting::Sensors, 17),
        set(Setting::Groups, 8),
        hello.clone(),
        Message::Start,
        drive.clone(),
        Message::Stop,
        set(Setting::Sensors, SENSORS_WITH_MOTORS.into()),
        hello,
        Message::Start,
        drive,
    ];
    let mut host = Questions {
        encoder: FrameEncoder::new(),
        decoder: FrameDecoder::new(),
        questions,
        results: Vec::new(),
        drives: Vec::new(),
        states: Vec::new(),
    };
    emulation::run(&board, 1, 1, &mut host);
    use AckResult::{Done, Refused, Unknown};
    assert_eq!(host.results, [Refused, Refused, Done, Unknown, Done, Done, Done]);
    assert_eq!(host.drives.last(), Some(&true));
    assert!(host.drives.contains(&false) && host.drives.is_sorted(), "{:?}", host.drives);
    assert_eq!(host.states.last(), Some(&MotionState::NoMotors), "no top speed is set: {:?}", host.states);
}
