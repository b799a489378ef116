//! The simulated board: fires the ring group by group, latches the encoders, answers the host.

use super::fault::Reading;
use super::motors::{MotorLimits, Motors};
use super::random::Random;
use super::robot::TICKS_PER_TURN;
use slamd_core::{Ring, Timestamp};
use slamd_protocol::{
    AckResult, Echo, Encoder, FrameBuf, FrameDecoder, FrameEncoder, Geometry, Hello, Message, MessageError, Motion,
    Placement, SensorEcho, Setting, Sonar, Status, Text, VERSION_MAJOR, VERSION_MINOR, WheelSpeeds, kind,
};
use std::time::Duration;

/// True temperature of the air, degrees Celsius.
const AIR_C: f64 = 21.5;

/// Highest speed of a wheel, millimetres per second: the simulated robot has motors.
const TOP_SPEED_MM_S: i32 = 600;

/// Microseconds from one group's trigger to the next. An echo from 3 m takes 17.5 ms.
pub const SLOT_US: u64 = 25_000;

/// A simulated board with its protocol state and settings.
#[derive(Debug)]
pub struct Board {
    ring: Ring,
    decoder: FrameDecoder,
    encoder: FrameEncoder,
    boot_id: u32,
    boot_us: u64,
    rate: f64,
    frames: u32,
    is_streaming: bool,
    /// True once the host has sent a valid frame since the board's start.
    is_greeted: bool,
    settings: [i32; Setting::ALL.len()],
    motors: Motors,
    /// Encoder counts at the start of the board.
    ticks_at_boot: [i32; 2],
    random: Random,
}

impl Board {
    /// A board whose clock is off by `drift_ppm`. Random are the sign, the boot id and the clock's start.
    #[must_use]
    pub fn new(ring: Ring, drift_ppm: f64, mut random: Random) -> Self {
        let [boot_id, boot_us] = [random.bits() & 0xFFFF_FFFF, random.bits() & 0xFFFF_FFFF];
        Self {
            decoder: FrameDecoder::new(),
            encoder: FrameEncoder::default(),
            boot_id: u32::try_from(boot_id).unwrap_or_default(),
            boot_us,
            rate: 1.0 + drift_ppm * 1e-6 * random.sign(),
            frames: 0,
            is_streaming: false,
            is_greeted: false,
            settings: settings(&ring),
            motors: Motors::new(ring.len()),
            ticks_at_boot: [0; 2],
            ring,
            random,
        }
    }

    /// Simulates a brief loss of power at `at`: the board boots with a new boot id, clock and
    /// tick origin, and waits for the host.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "microseconds of a session")]
    pub fn restart(&mut self, at: Timestamp, ticks: [i32; 2]) -> FrameBuf {
        self.boot_id = u32::from_le_bytes(self.random.bits().to_le_bytes()[..4].try_into().unwrap_or_default());
        self.boot_us = (self.random.bits() & 0xFFFF_FFFF).wrapping_sub((at.us() as f64 * self.rate) as u64);
        self.ticks_at_boot = ticks;
        (self.is_streaming, self.is_greeted) = (false, false);
        self.motors = Motors::new(self.ring.len());
        (self.decoder, self.encoder, self.frames) = (FrameDecoder::new(), FrameEncoder::default(), 0);
        self.hello()
    }

    /// Advances the board's clock by `span` and changes nothing else.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "microseconds of a session")]
    pub fn pass(&mut self, span: Duration) {
        self.boot_us = self.boot_us.wrapping_add((span.as_secs_f64() * 1e6 * self.rate) as u64);
    }

    /// The sensors' mountings and firing groups.
    #[must_use]
    pub fn ring(&self) -> &Ring {
        &self.ring
    }

    /// True once the host has asked for readings.
    #[must_use]
    pub fn is_streaming(&self) -> bool {
        self.is_streaming
    }

    /// True once the host has sent a valid frame. Until then the board repeats its Hello.
    #[must_use]
    pub fn is_greeted(&self) -> bool {
        self.is_greeted
    }

    /// The board's 32-bit clock.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the low 32 bits are meant")]
    pub fn clock_us(&self, at: Timestamp) -> u32 {
        self.boot_us.wrapping_add((at.us() as f64 * self.rate) as u64) as u32
    }

    /// Handles bytes from the host and returns the answers.
    pub fn hear(&mut self, at: Timestamp, bytes: &[u8]) -> Vec<FrameBuf> {
        let mut answers = Vec::new();
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            let (of_type, of_seq) = (frame.kind, frame.seq);
            let message = match Message::parse(frame.kind, frame.payload) {
                Ok(message) => message,
                Err(MessageError::Value { .. }) if of_type == kind::DRIVE => {
                    answers.push(self.frame(&Message::Ack { of_type, of_seq, result: AckResult::Refused }));
                    continue;
                }
                Err(_) => continue,
            };
            self.is_greeted = true;
            self.motors.heard(at);
            let result = match message {
                Message::Drive(drive) if self.is_streaming => {
                    self.motors.drive(at, &drive);
                    continue;
                }
                Message::Drive(_) => AckResult::Busy,
                Message::HelloRequest { .. } => {
                    answers.push(self.hello());
                    continue;
                }
                Message::GeometryRequest => {
                    answers.extend(self.geometry());
                    continue;
                }
                Message::TimeRequest { token } => {
                    let now_us = self.clock_us(at);
                    answers.push(self.frame(&Message::TimeResponse { token, rx_us: now_us, tx_us: now_us }));
                    continue;
                }
                Message::ConfigGet { key } => match Setting::from_key(key) {
                    Some(setting) => {
                        let value = self.setting(setting);
                        answers.push(self.frame(&Message::ConfigValue { key, value }));
                        continue;
                    }
                    None => AckResult::Unknown,
                },
                Message::ConfigSet { key, value } => {
                    Setting::from_key(key).map_or(AckResult::Unknown, |setting| self.set(setting, value))
                }
                Message::Start | Message::Stop => {
                    self.is_streaming = message == Message::Start;
                    if !self.is_streaming {
                        self.motors.stop();
                    }
                    AckResult::Done
                }
                _ => continue,
            };
            answers.push(self.frame(&Message::Ack { of_type, of_seq, result }));
        }
        answers
    }

    fn setting(&self, setting: Setting) -> i32 {
        self.settings[usize::from(setting.key()) - 1]
    }

    /// The motors.
    #[must_use]
    pub fn motors(&self) -> &Motors {
        &self.motors
    }

    /// One step of the motors' control. MOTION if their state has changed.
    pub fn control(&mut self, at: Timestamp, measured_m_s: [f64; 2]) -> Option<FrameBuf> {
        let limits = self.motor_limits();
        self.motors.step(at, &self.ring, limits).then(|| self.motion(at, measured_m_s))
    }

    /// MOTION: what the motors do, with the speeds that the encoders measure.
    #[expect(clippy::cast_possible_truncation, reason = "millimetres per second of a robot")]
    pub fn motion(&mut self, at: Timestamp, measured_m_s: [f64; 2]) -> FrameBuf {
        let mm_s = |m_s: f64| (1e3 * m_s).round() as i16;
        let [left, right] = self.motors.commanded_m_s().map(mm_s);
        let [left_mm_s, right_mm_s] = measured_m_s.map(mm_s);
        let commanded = WheelSpeeds::new(left, right).unwrap_or_default();
        let state = self.motors.state();
        self.frame(&Message::Motion(Motion { t_us: self.clock_us(at), state, commanded, left_mm_s, right_mm_s }))
    }

    fn motor_limits(&self) -> MotorLimits {
        let metres = |setting| 1e-3 * f64::from(self.setting(setting));
        MotorLimits {
            top_speed_m_s: metres(Setting::TopSpeedMmS),
            acceleration_m_s2: metres(Setting::AccelerationMmS2),
            stop_distance_m: metres(Setting::StopDistanceMm),
        }
    }

    /// Accepts changes of the wheels and the motors only: the ring is fixed.
    fn set(&mut self, setting: Setting, value: i32) -> AckResult {
        if value == self.setting(setting) {
            return AckResult::Done;
        }
        let is_wheels = matches!(setting, Setting::LeftReversed | Setting::RightReversed | Setting::WheelsSwapped);
        let is_motors = setting.key() >= Setting::TopSpeedMmS.key();
        if !(is_wheels || is_motors) || !setting.range().contains(&value) {
            return AckResult::Refused;
        }
        if is_motors && self.is_streaming {
            return AckResult::Busy;
        }
        self.settings[usize::from(setting.key()) - 1] = value;
        AckResult::Done
    }

    /// The wheels' counts as the board reports them: since boot, swapped and reversed as configured.
    fn counts(&self, ticks: [i32; 2]) -> [i32; 2] {
        let since_boot = [0, 1].map(|wheel| ticks[wheel].wrapping_sub(self.ticks_at_boot[wheel]));
        let sign = |setting| if self.setting(setting) == 1 { -1 } else { 1 };
        let [left, right] =
            if self.setting(Setting::WheelsSwapped) == 1 { [since_boot[1], since_boot[0]] } else { since_boot };
        [left.wrapping_mul(sign(Setting::LeftReversed)), right.wrapping_mul(sign(Setting::RightReversed))]
    }

    /// The board's identity and protocol version.
    pub fn hello(&mut self) -> FrameBuf {
        self.frame(&Message::Hello(Hello {
            major: VERSION_MAJOR,
            minor: VERSION_MINOR,
            boot_id: self.boot_id,
            tick_hz: 1_000_000,
            sensors: u8::try_from(self.ring.len()).unwrap_or(u8::MAX),
            ticks_per_turn: TICKS_PER_TURN,
            capabilities: Hello::CAPABILITY_DRIVES,
            config_crc: 0,
            uid: *b"slamdsim",
            board: Text::new("simulator"),
            firmware: Text::new(env!("CARGO_PKG_VERSION")),
        }))
    }

    /// The readings of one firing group, with the encoder counts at the trigger.
    pub fn sonar(
        &mut self,
        trigger: Timestamp,
        group: u8,
        is_last: bool,
        ticks: [i32; 2],
        readings: &[(u8, Reading)],
    ) -> FrameBuf {
        readings.iter().for_each(|&(sensor, reading)| self.motors.see(sensor, reading));
        let echoes = readings.iter().filter_map(|&(sensor, reading)| {
            let echo = match reading {
                Reading::Range(range_m) => flight(range_m),
                Reading::NoEcho => Echo::NoEcho,
                Reading::Missing => return None,
            };
            Some(SensorEcho { sensor, echo })
        });
        let ticks = self.counts(ticks);
        let sonar = Sonar {
            t_us: self.clock_us(trigger),
            group,
            last_of_cycle: is_last,
            left_ticks: ticks[0],
            right_ticks: ticks[1],
            echoes: echoes.collect(),
        };
        self.frame(&Message::Sonar(sonar))
    }

    /// An encoder message at `at`.
    pub fn encoders(&mut self, at: Timestamp, ticks: [i32; 2]) -> FrameBuf {
        let (t_us, ticks) = (self.clock_us(at), self.counts(ticks));
        self.frame(&Message::Encoder(Encoder { t_us, left_ticks: ticks[0], right_ticks: ticks[1], flags: 0 }))
    }

    /// The board's status report.
    #[expect(clippy::cast_possible_truncation, reason = "an air temperature")]
    pub fn status(&mut self, at: Timestamp) -> FrameBuf {
        self.frame(&Message::Status(Status {
            t_us: self.clock_us(at),
            frames: self.frames,
            overruns: 0,
            crc_errors: u32::try_from(self.decoder.counters().crc_errors).unwrap_or(u32::MAX),
            temperature_cdeg: Some((AIR_C * 100.0) as i16),
            supply_mv: std::num::NonZeroU16::new(5_020),
            stuck_mask: 0,
        }))
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "millimetres and hundredths of degrees of a robot"
    )]
    fn geometry(&mut self) -> Vec<FrameBuf> {
        let placements: Vec<Placement> = self
            .ring
            .mountings
            .iter()
            .map(|mounting| {
                let pose = mounting.robot_from_sensor;
                Placement {
                    x_mm: (pose.x_m * 1e3).round() as i16,
                    y_mm: (pose.y_m * 1e3).round() as i16,
                    bearing_cdeg: (pose.theta_rad.to_degrees() * 1e2).round() as i16,
                    half_angle_cdeg: (mounting.half_angle_rad.to_degrees() * 1e2).round() as u16,
                    group: mounting.group,
                }
            })
            .collect();
        let parts = Geometry::of_ring(&placements).unwrap_or_default();
        parts.into_iter().map(|part| self.frame(&Message::Geometry(part))).collect()
    }

    fn frame(&mut self, message: &Message) -> FrameBuf {
        self.frames = self.frames.wrapping_add(1);
        self.encoder.encode(message)
    }
}

/// The settings of a board with this ring.
#[expect(clippy::cast_possible_truncation, reason = "millimetres and hundredths of degrees of a robot")]
fn settings(ring: &Ring) -> [i32; Setting::ALL.len()] {
    let mut values = Setting::ALL.map(Setting::default);
    let mut set = |setting: Setting, value: i32| values[usize::from(setting.key()) - 1] = value;
    let groups = ring.mountings.iter().map(|mounting| mounting.group).max().unwrap_or(0);
    set(Setting::Sensors, i32::try_from(ring.len()).unwrap_or(0));
    set(Setting::Groups, i32::from(groups) + 1);
    set(Setting::TicksPerTurn, i32::try_from(TICKS_PER_TURN).unwrap_or(0));
    set(Setting::TopSpeedMmS, TOP_SPEED_MM_S);
    if let Some(first) = ring.mountings.first() {
        let pose = first.robot_from_sensor;
        set(Setting::RingRadiusMm, (pose.position().coords.norm() * 1e3).round() as i32);
        set(Setting::HalfAngleCdeg, (first.half_angle_rad.to_degrees() * 1e2).round() as i32);
    }
    values
}

/// Time of flight to a surface at `range_m` and back.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a range within the sensor's limits")]
fn flight(range_m: f64) -> Echo {
    Echo::from_flight_us((range_m * 2e6 / (331.3 + 0.606 * AIR_C)).round() as u32)
}
