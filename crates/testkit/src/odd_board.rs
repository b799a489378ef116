//! A board of eight sensors by hand, with the mistakes of firmware that others wrote. It drives straight ahead past walls; its frames come
//! as soon as they are made.

use slamd_protocol::{
    AckResult, DELIMITER, Echo, Encoder, FrameDecoder, FrameEncoder, Geometry, Hello, Message, PayloadBuf, Placement,
    SensorEcho, Sonar, Status, Text, encode_frame, kind,
};

/// A mistake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oddity {
    /// None.
    None,
    /// It streams from the start and hears nothing.
    Mute,
    /// SONAR numbers its sensors from 100.
    Ids,
    /// GEOMETRY gives bearings from 0 to 360 degrees.
    Bearings,
    /// GEOMETRY gives half angles of 95 degrees.
    HalfAngles,
    /// GEOMETRY places one sensor more than HELLO says.
    Count,
    /// START begins the cycle again, also while the ring fires.
    Restarts,
    /// START is acknowledged, but the ring never fires.
    NeverFires,
    /// A line of text ten times a second.
    Prints,
    /// Stamps count milliseconds.
    Milliseconds,
    /// For one of seven seconds the stamps of all but TIME_RESPONSE are half a second behind.
    RunsBack,
    /// The air's temperature, hundredths of a degree.
    Air(i16),
    /// The robot stands.
    Rests,
    /// Each group holds a sensor of the next one.
    Overlap,
    /// The sensors of a group measure the same echo.
    Crosstalk,
    /// Counts wrap at 16 bits.
    Wraps,
    /// The same, from −32,768 to 32,767.
    WrapsSigned,
    /// A group fires every quarter of a second: one sweep takes a second.
    SlowSlots,
    /// Counts begin again at zero after ten seconds.
    StartsAnew,
    /// One count in a hundred is zero.
    Zeros,
    /// The wheels count this many times the way.
    Scale(i32),
}

/// The board.
pub struct OddBoard {
    oddity: Oddity,
    encoder: FrameEncoder,
    decoder: FrameDecoder,
    out: Vec<u8>,
    now_us: u64,
    is_greeted: bool,
    /// When the ring began to fire.
    since_us: Option<u64>,
    group: u8,
    counted: u32,
    /// Commands heard: START, TIME_REQUEST.
    heard: [u32; 2],
}

/// Sensors, groups and the time of a group in microseconds.
pub const SENSORS: u8 = 8;
const GROUPS: u8 = 4;
const SLOT_US: u64 = 25_000;
/// Ticks per turn, as HELLO says.
pub const TICKS_PER_TURN: u32 = 1_440;
/// 0.3 m/s on wheels of 35 mm: ticks per second.
pub const TICKS_PER_S: i64 = 1_964;
/// The robot stands this long first, as a board that was just switched on, and its clock starts here, microseconds.
const STANDS_US: u64 = 2_000_000;
const BOOT_US: u64 = 3_000_000;

impl OddBoard {
    /// A board with a mistake, just switched on.
    #[must_use]
    pub fn new(oddity: Oddity) -> Self {
        Self {
            oddity,
            encoder: FrameEncoder::default(),
            decoder: FrameDecoder::new(),
            out: vec![DELIMITER],
            now_us: 0,
            is_greeted: false,
            since_us: (oddity == Oddity::Mute).then_some(0),
            group: 0,
            counted: 0,
            heard: [0; 2],
        }
    }

    /// How often START and TIME_REQUEST were heard.
    #[must_use]
    pub fn heard(&self) -> [u32; 2] {
        self.heard
    }

    /// Runs for so many seconds. `exchange` takes the time in microseconds and what the board says, and gives what it hears.
    pub fn run(&mut self, seconds: u64, mut exchange: impl FnMut(u64, &[u8]) -> Vec<u8>) {
        let end_us = self.now_us + seconds * 1_000_000;
        while self.now_us < end_us {
            self.now_us += 1_000;
            self.speak();
            let said = std::mem::take(&mut self.out);
            let heard = exchange(self.now_us, &said);
            self.hear(&heard);
        }
    }

    fn hear(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            let (seq, heard) = (frame.seq, Message::parse(frame.kind, frame.payload));
            let Ok(message) = heard else { continue };
            self.heard[0] += u32::from(message == Message::Start);
            self.heard[1] += u32::from(matches!(message, Message::TimeRequest { .. }));
            if self.oddity != Oddity::Mute {
                self.answer(seq, &message);
            }
        }
    }

    fn answer(&mut self, seq: u8, message: &Message) {
        self.is_greeted = true;
        match message {
            Message::HelloRequest { .. } => self.hello(),
            Message::GeometryRequest => self.geometry(),
            Message::TimeRequest { token } => {
                let now = self.clock_us();
                self.send(&Message::TimeResponse { token: *token, rx_us: now, tx_us: now });
            }
            Message::Start => {
                self.send(&Message::Ack { of_type: kind::START, of_seq: seq, result: AckResult::Done });
                let begins = self.since_us.is_none() || self.oddity == Oddity::Restarts;
                if begins && self.oddity != Oddity::NeverFires {
                    (self.since_us, self.group) = (Some(self.now_us), 0);
                }
            }
            _ => {}
        }
    }

    fn speak(&mut self) {
        if !self.is_greeted && self.oddity != Oddity::Mute && self.now_us.is_multiple_of(100_000) {
            self.hello();
        }
        let Some(since_us) = self.since_us else { return };
        let firing_us = self.now_us - since_us;
        if firing_us > 0 && firing_us.is_multiple_of(self.slot_us()) {
            self.sonar();
        }
        if self.now_us.is_multiple_of(20_000) {
            let [left_ticks, right_ticks] = self.ticks(0);
            self.send(&Message::Encoder(Encoder { t_us: self.stamp(0), left_ticks, right_ticks, flags: 0 }));
        }
        if self.now_us.is_multiple_of(1_000_000) {
            let cdeg = if let Oddity::Air(cdeg) = self.oddity { cdeg } else { 2_000 };
            let t_us = self.stamp(0);
            self.send(&Message::Status(Status { t_us, temperature_cdeg: Some(cdeg), ..Status::default() }));
        }
        if self.oddity == Oddity::Prints && self.now_us.is_multiple_of(100_000) {
            self.out.extend_from_slice(b"dist=23 cm\r\n");
        }
    }

    fn send(&mut self, message: &Message) {
        self.out.extend_from_slice(&self.encoder.encode(message));
    }

    fn hello(&mut self) {
        self.send(&Message::Hello(Hello {
            major: slamd_protocol::VERSION_MAJOR,
            minor: slamd_protocol::VERSION_MINOR,
            boot_id: 7,
            tick_hz: 1_000_000,
            sensors: SENSORS,
            ticks_per_turn: TICKS_PER_TURN,
            capabilities: 0,
            config_crc: 1,
            uid: *b"oddboard",
            board: Text::new("odd"),
            firmware: Text::new("by hand"),
        }));
    }

    fn geometry(&mut self) {
        let place = |sensor: u8| {
            let bearing_cdeg = 4_500 * i16::from(sensor % SENSORS);
            let wrapped = if bearing_cdeg > 18_000 { bearing_cdeg - 18_000 - 18_000 } else { bearing_cdeg };
            Placement { x_mm: 0, y_mm: 0, bearing_cdeg: wrapped, half_angle_cdeg: 1_250, group: sensor % GROUPS }
        };
        if !matches!(self.oddity, Oddity::Bearings | Oddity::HalfAngles) {
            let sensors = SENSORS + u8::from(self.oddity == Oddity::Count);
            let ring: Vec<Placement> = (0..sensors).map(place).collect();
            for part in Geometry::of_ring(&ring).expect("a ring of eight") {
                self.send(&Message::Geometry(part));
            }
            return;
        }
        let mut payload = PayloadBuf::new();
        payload.extend([SENSORS, 0]);
        for sensor in 0..SENSORS {
            payload.extend([0; 4]);
            payload.extend((4_500 * u16::from(sensor)).to_le_bytes());
            let half_angle_cdeg: u16 = if self.oddity == Oddity::HalfAngles { 9_500 } else { 1_250 };
            payload.extend(half_angle_cdeg.to_le_bytes());
            payload.push(sensor % GROUPS);
        }
        self.out.extend_from_slice(&encode_frame(kind::GEOMETRY, 0, &payload));
    }

    fn slot_us(&self) -> u64 {
        if self.oddity == Oddity::SlowSlots { 10 * SLOT_US } else { SLOT_US }
    }

    fn clock_us(&self) -> u32 {
        u32::try_from(BOOT_US + self.now_us).expect("a test shorter than an hour")
    }

    /// A stamp of `before_us` ago.
    fn stamp(&self, before_us: u64) -> u32 {
        let us = self.clock_us() - u32::try_from(before_us).expect("a slot");
        match self.oddity {
            Oddity::Milliseconds => us / 1_000,
            Oddity::RunsBack if self.now_us > 5_000_000 && self.now_us % 7_000_000 < 1_000_000 => us - 500_000,
            _ => us,
        }
    }

    /// Ticks of both wheels `before_us` ago.
    fn true_ticks(&self, before_us: u64) -> i64 {
        let driven_us = self.now_us.saturating_sub(STANDS_US + before_us);
        let driven_us = if self.oddity == Oddity::Rests { 0 } else { driven_us };
        i64::try_from(driven_us).expect("a test shorter than an hour") * TICKS_PER_S / 1_000_000
    }

    #[expect(clippy::cast_possible_truncation, reason = "counters wrap")]
    fn ticks(&mut self, before_us: u64) -> [i32; 2] {
        self.counted += 1;
        let ticks = self.true_ticks(before_us) as i32;
        match self.oddity {
            Oddity::Wraps => [ticks & 0xFFFF; 2],
            Oddity::WrapsSigned => [i32::from(ticks as i16); 2],
            Oddity::StartsAnew if self.now_us - before_us >= 10_000_000 => [ticks - (8 * TICKS_PER_S) as i32; 2],
            Oddity::Zeros if self.counted.is_multiple_of(100) => [0, ticks],
            Oddity::Scale(scale) => [scale * ticks; 2],
            _ => [ticks; 2],
        }
    }

    /// A room's echo, which changes as the robot drives and with noise.
    fn echo_us(&self, sensor: u8) -> u16 {
        let noise = (self.now_us / 1_000 + 31 * u64::from(sensor)).wrapping_mul(2_654_435_761) >> 7 & 63;
        let way = u64::try_from(self.true_ticks(0)).unwrap_or(0) / 8 % 3_000;
        let way = if way > 1_500 { 3_000 - way } else { way };
        u16::try_from(5_000 + 400 * u64::from(sensor) + way + noise).expect("below 10 ms")
    }

    fn sonar(&mut self) {
        let slot_us = self.slot_us();
        let (group, [left_ticks, right_ticks]) = (self.group, self.ticks(slot_us));
        let next = (group + 1) % GROUPS;
        let is_fired =
            |sensor: &u8| sensor % GROUPS == group || self.oddity == Oddity::Overlap && sensor % GROUPS == next;
        let echoes = (0..SENSORS).filter(is_fired).map(|sensor| {
            let us = self.echo_us(if self.oddity == Oddity::Crosstalk { group } else { sensor });
            let sensor = if self.oddity == Oddity::Ids { sensor + 100 } else { sensor };
            SensorEcho { sensor, echo: Echo::Flight { us } }
        });
        let sonar = Sonar {
            t_us: self.stamp(slot_us),
            group,
            last_of_cycle: next == 0,
            left_ticks,
            right_ticks,
            echoes: echoes.collect(),
        };
        self.group = next;
        self.send(&Message::Sonar(sonar));
    }
}
