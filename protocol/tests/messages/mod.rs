//! Arbitrary messages.

#![allow(dead_code, reason = "each test uses its part")]

use core::num::NonZeroU16;
use proptest::prelude::*;
use slamd_protocol::{
    AckResult, Drive, Echo, Encoder, Fault, FaultCode, Geometry, Hello, Log, MAX_ECHOES, MAX_PLACEMENTS, Message,
    Motion, MotionState, Placement, SensorEcho, Sonar, Status, Text, WheelSpeeds,
};

/// Any message of any type.
pub(crate) fn message() -> impl Strategy<Value = Message> {
    prop_oneof![
        hello().prop_map(Message::Hello),
        geometry().prop_map(Message::Geometry),
        sonar().prop_map(Message::Sonar),
        encoder().prop_map(Message::Encoder),
        status().prop_map(Message::Status),
        fault().prop_map(Message::Fault),
        motion().prop_map(Message::Motion),
        drive().prop_map(Message::Drive),
        any::<(u16, u32, u32)>().prop_map(|(token, rx_us, tx_us)| Message::TimeResponse { token, rx_us, tx_us }),
        (any::<(u8, u8)>(), ack_result()).prop_map(|((of_type, of_seq), result)| Message::Ack {
            of_type,
            of_seq,
            result
        }),
        any::<(u8, i32)>().prop_map(|(key, value)| Message::ConfigValue { key, value }),
        any::<(u8, String)>().prop_map(|(level, text)| Message::Log(Log { level, text: Text::new(&text) })),
        any::<(u8, u8)>().prop_map(|(major, minor)| Message::HelloRequest { major, minor }),
        any::<(u8, i32)>().prop_map(|(key, value)| Message::ConfigSet { key, value }),
        any::<u8>().prop_map(|key| Message::ConfigGet { key }),
        any::<u16>().prop_map(|token| Message::TimeRequest { token }),
        Just(Message::Start),
        Just(Message::Stop),
        Just(Message::GeometryRequest),
        Just(Message::Heartbeat),
    ]
}

/// The `number`th message of a plausible stream: mostly SONAR, with content from `byte`.
pub(crate) fn message_of(number: u64, byte: &mut impl FnMut() -> u8) -> Message {
    let mut u16 = || u16::from_le_bytes([byte(), byte()]);
    let t_us = u32::from(u16()) << 16 | u32::from(u16());
    let (left_ticks, right_ticks) = (u16().into(), i32::from(u16()) - 32_768);
    match number % 8 {
        0 => Message::Encoder(Encoder { t_us, left_ticks, right_ticks, flags: 0 }),
        1 => Message::TimeResponse { token: u16(), rx_us: t_us, tx_us: t_us.wrapping_add(u16().into()) },
        _ => {
            let echoes =
                (0..8).map(|sensor| SensorEcho { sensor, echo: Echo::from_flight_us(u32::from(u16()) * 2) }).collect();
            Message::Sonar(Sonar { t_us, group: 0, last_of_cycle: number % 4 == 3, left_ticks, right_ticks, echoes })
        }
    }
}

fn hello() -> impl Strategy<Value = Hello> {
    (any::<(u8, u8, u32, u32, u8)>(), any::<(u32, u32, u32, [u8; 8])>(), any::<(String, String)>()).prop_map(
        |(
            (major, minor, boot_id, tick_hz, sensors),
            (ticks_per_turn, capabilities, config_crc, uid),
            (board, firmware),
        )| {
            let (board, firmware) = (Text::new(&board), Text::new(&firmware));
            Hello {
                major,
                minor,
                boot_id,
                tick_hz,
                sensors,
                ticks_per_turn,
                capabilities,
                config_crc,
                uid,
                board,
                firmware,
            }
        },
    )
}

fn geometry() -> impl Strategy<Value = Geometry> {
    let placement = (any::<(i16, i16, u8)>(), any::<i16>(), 0..=9_000_u16).prop_map(
        |((x_mm, y_mm, group), bearing_cdeg, half_angle_cdeg)| Placement {
            x_mm,
            y_mm,
            bearing_cdeg,
            half_angle_cdeg,
            group,
        },
    );
    (0..=32_u8, 26..=32_u8, prop::collection::vec(placement, 0..=MAX_PLACEMENTS)).prop_map(
        |(first, more, placements)| Geometry::new(first + more, first, &placements).expect("all within the ring"),
    )
}

fn sonar() -> impl Strategy<Value = Sonar> {
    let echo = prop_oneof![
        8 => (0..=Echo::MAX_FLIGHT_US).prop_map(|us| Echo::Flight { us }),
        1 => Just(Echo::NoEcho),
        1 => Just(Echo::PinStuck),
        1 => Just(Echo::HighAtTrigger),
        1 => Just(Echo::Disabled),
        1 => Just(Echo::Blanked),
    ];
    let echoes = prop::collection::vec((any::<u8>(), echo), 0..=MAX_ECHOES);
    (any::<(u32, u8, bool, i32, i32)>(), echoes).prop_map(
        |((t_us, group, last_of_cycle, left_ticks, right_ticks), echoes)| {
            let echoes = echoes.into_iter().map(|(sensor, echo)| SensorEcho { sensor, echo }).collect();
            Sonar { t_us, group, last_of_cycle, left_ticks, right_ticks, echoes }
        },
    )
}

fn encoder() -> impl Strategy<Value = Encoder> {
    any::<(u32, i32, i32, u8)>().prop_map(|(t_us, left_ticks, right_ticks, flags)| Encoder {
        t_us,
        left_ticks,
        right_ticks,
        flags,
    })
}

fn status() -> impl Strategy<Value = Status> {
    let temperature = prop::option::of(i16::MIN..i16::MAX);
    (any::<(u32, u32, u32, u32)>(), temperature, any::<u16>(), any::<u64>()).prop_map(
        |((t_us, frames, overruns, crc_errors), temperature_cdeg, supply_mv, stuck_mask)| Status {
            t_us,
            frames,
            overruns,
            crc_errors,
            temperature_cdeg,
            supply_mv: NonZeroU16::new(supply_mv),
            stuck_mask,
        },
    )
}

fn fault() -> impl Strategy<Value = Fault> {
    use FaultCode::{Cleared, HighAtTrigger, NeverAnswers, PinStuck};
    let code = prop::sample::select(vec![Cleared, PinStuck, HighAtTrigger, NeverAnswers]);
    (any::<(u32, u8)>(), code).prop_map(|((t_us, sensor), code)| Fault { t_us, sensor, code })
}

fn speeds() -> impl Strategy<Value = WheelSpeeds> {
    let each = -WheelSpeeds::MAX_MM_S..=WheelSpeeds::MAX_MM_S;
    (each.clone(), each).prop_map(|(left, right)| WheelSpeeds::new(left, right).expect("in range"))
}

fn drive() -> impl Strategy<Value = Drive> {
    (speeds(), Drive::VALID_MS, any::<u8>())
        .prop_map(|(speeds, valid_ms, source)| Drive::new(speeds, valid_ms, source).expect("in range"))
}

fn motion() -> impl Strategy<Value = Motion> {
    use MotionState::{Driving, EmergencyPin, Idle, NoMotors, Obstacle, Stall, TimeOut};
    let state = prop::sample::select(vec![Idle, Driving, TimeOut, Obstacle, Stall, EmergencyPin, NoMotors]);
    (any::<(u32, i16, i16)>(), state, speeds()).prop_map(|((t_us, left_mm_s, right_mm_s), state, commanded)| Motion {
        t_us,
        state,
        commanded,
        left_mm_s,
        right_mm_s,
    })
}

fn ack_result() -> impl Strategy<Value = AckResult> {
    prop::sample::select(vec![AckResult::Done, AckResult::Unknown, AckResult::Refused, AckResult::Busy])
}
