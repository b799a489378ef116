//! The firmware's core behaves as the protocol says on a simulated board, and the image for the
//! Mega builds and fits.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod board;

use board::Script;
use slamd_protocol::{AckResult, Echo, FaultCode, Message, Setting};
use std::path::Path;
use std::process::Command;

/// All echoes of sensor 5.
fn echoes(messages: &[Message]) -> Vec<Echo> {
    let sonars = messages.iter().filter_map(|m| if let Message::Sonar(sonar) = m { Some(sonar) } else { None });
    sonars.flat_map(|sonar| sonar.echoes.iter().filter(|heard| heard.sensor == 5).map(|heard| heard.echo)).collect()
}

fn faults(messages: &[Message]) -> Vec<(u8, FaultCode)> {
    let of = |m: &Message| if let Message::Fault(fault) = m { Some((fault.sensor, fault.code)) } else { None };
    messages.iter().filter_map(of).collect()
}

fn results(messages: &[Message]) -> Vec<AckResult> {
    let of = |m: &Message| if let Message::Ack { result, .. } = m { Some(*result) } else { None };
    messages.iter().filter_map(of).collect()
}

#[test]
fn it_greets_places_its_sensors_and_tells_the_time() {
    let messages = Script::boot(1000)
        .say(&Message::HelloRequest { major: 1, minor: 0 })
        .say(&Message::GeometryRequest)
        .say(&Message::TimeRequest { token: 77 })
        .messages();
    let [Message::Hello(boot), Message::Hello(asked), Message::Geometry(one), Message::Geometry(two), time] =
        messages.as_slice()
    else {
        panic!("{messages:?}")
    };
    assert_eq!(boot, asked);
    assert_eq!((usize::from(one.total()), one.placements().len() + two.placements().len()), (32, 32));
    assert_eq!((one.placements()[8].x_mm, one.placements()[8].y_mm, one.placements()[8].bearing_cdeg), (0, 150, 9000));
    let Message::TimeResponse { token: 77, rx_us, tx_us } = time else { panic!("{time:?}") };
    assert_eq!(tx_us - rx_us, 85);
}

#[test]
fn settings_are_kept_over_a_restart_and_guarded() {
    let messages = Script::boot(0)
        .set(Setting::Groups, 3)
        .set(Setting::Groups, 8)
        .set(Setting::Sensors, 33)
        .say(&Message::ConfigSet { key: 99, value: 0 })
        .say(&Message::Start)
        .set(Setting::Groups, 4)
        .then("boot 0")
        .say(&Message::ConfigGet { key: Setting::Groups.key() })
        .messages();
    use AckResult::{Busy, Done, Refused, Unknown};
    assert_eq!(results(&messages), [Refused, Done, Refused, Unknown, Done, Busy]);
    assert!(messages.contains(&Message::ConfigValue { key: Setting::Groups.key(), value: 8 }));
    let hellos: Vec<_> =
        messages.iter().filter_map(|m| if let Message::Hello(hello) = m { Some(hello) } else { None }).collect();
    assert_ne!(hellos[0].boot_id, hellos[1].boot_id);
    assert_ne!(hellos[0].config_crc, hellos[1].config_crc);
}

#[test]
fn every_sensor_is_heard_also_while_the_clock_wraps() {
    let messages = Script::boot(u32::MAX - 300_000).say(&Message::Start).then("run 1000000").messages();
    let heard = echoes(&messages);
    assert!((9..=11).contains(&heard.len()), "{heard:?}");
    assert!(heard.iter().all(|echo| matches!(echo, Echo::Flight { us: 5_950..=6_050 })), "{heard:?}");
    assert_eq!(faults(&messages), []);
}

#[test]
fn a_stuck_pin_is_told_when_it_begins_and_when_it_ends() {
    let messages = Script::boot(0)
        .then("sensor 5 -1")
        .say(&Message::Start)
        .then("run 1000000\nsensor 5 6000\nrun 500000")
        .messages();
    assert_eq!(faults(&messages), [(5, FaultCode::PinStuck), (5, FaultCode::Cleared)]);
    assert_eq!(echoes(&messages)[0], Echo::PinStuck);
    assert!(messages.iter().any(|m| matches!(m, Message::Status(status) if status.stuck_mask == 1 << 5)));
}

#[test]
fn what_is_too_far_or_mute_is_no_range() {
    let far = Script::boot(0).then("sensor 5 20000").say(&Message::Start).then("run 300000").messages();
    assert!(echoes(&far).iter().all(|echo| *echo == Echo::NoEcho) && !echoes(&far).is_empty());
    let never_falls = Script::boot(0).then("sensor 5 -2").say(&Message::Start).then("run 50000").messages();
    assert_eq!(echoes(&never_falls)[..], [Echo::NoEcho]);
    let mute = Script::boot(0).then("sensor 5 0").say(&Message::Start).then("run 1500000").messages();
    assert_eq!(echoes(&mute), []);
    assert_eq!(faults(&mute), [(5, FaultCode::NeverAnswers)]);
}

#[test]
fn wheels_count_every_edge_reversed_and_swapped() {
    let counts = |script: Script| {
        let messages = script.then("turn 0 40\nturn 1 -7").say(&Message::Start).then("run 50000").messages();
        let last = messages.iter().rev().find_map(|m| if let Message::Encoder(e) = m { Some(*e) } else { None });
        last.map(|encoder| (encoder.left_ticks, encoder.right_ticks)).unwrap()
    };
    assert_eq!(counts(Script::boot(0)), (40, -7));
    assert_eq!(counts(Script::boot(0).set(Setting::LeftReversed, 1)), (-40, -7));
    assert_eq!(counts(Script::boot(0).set(Setting::WheelsSwapped, 1).set(Setting::RightReversed, 1)), (-7, -40));
}

#[test]
fn frames_that_find_the_line_busy_are_counted() {
    let script = Script::boot(0).say(&Message::Start).then("busy 1\nrun 500000\nbusy 0\nrun 1500000");
    let last =
        script.messages().into_iter().rev().find_map(|m| if let Message::Status(s) = m { Some(s) } else { None });
    assert!((40..=50).contains(&last.unwrap().overruns), "{last:?}");
}

#[test]
fn noise_never_stops_it() {
    let mut state = 1_u32;
    let noise: Vec<u8> = std::iter::repeat_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    })
    .take(50_000)
    .collect();
    let messages = Script::boot(0).hear(&noise).then("run 100000").hear(&[0]).say(&Message::Start).messages();
    assert_eq!(results(&messages), [AckResult::Done]);
}

#[test]
fn the_image_for_the_mega_builds_without_warnings_and_fits() {
    let build = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mega");
    let found = Command::new("avr-gcc").arg("--version").output().is_ok();
    assert!(found, "avr-gcc is missing: apt-get install gcc-avr avr-libc make");
    let made = Command::new("make")
        .args(["-B", "-C", concat!(env!("CARGO_MANIFEST_DIR"), "/firmware")])
        .arg(format!("BUILD={}", build.display()))
        .output()
        .expect("make: apt-get install make");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(String::from_utf8_lossy(&made.stderr), "");
    let size = Command::new("avr-size").arg(build.join("slamd_ring_mega2560.elf")).output().unwrap().stdout;
    let text = String::from_utf8(size).unwrap();
    let sizes: Vec<u32> = text.lines().nth(1).unwrap().split_whitespace().flat_map(str::parse).collect();
    let [code, data, bss, ..] = sizes[..] else { panic!("{text}") };
    assert!(code + data <= 32 * 1024 && data + bss <= 4 * 1024, "{text}");
}
