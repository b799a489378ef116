//! What the pipeline says of boards with mistakes, and that it goes on sanely with them.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::link::{Link, LinkState};
use slamd_core::{Config, Counters, Driver, Event, Input, Pipeline, Start, Timestamp, Update};
use slamd_testkit::odd_board::{OddBoard, Oddity, TICKS_PER_S, TICKS_PER_TURN};
use std::f64::consts::TAU;

/// What a session with such a board gave.
struct Met {
    troubles: Vec<String>,
    resets: usize,
    counters: Counters,
    /// The link's causes while groups or frames arrive.
    causes: Vec<String>,
    heard: [u32; 2],
    /// The left wheel's path, metres.
    rolled_m: f64,
    /// The longest step of the left wheel between two sweeps, metres.
    longest_m: f64,
    temperature_range_m: f64,
}

fn meet(oddity: Oddity, seconds: u64) -> Met {
    let mut driver = Driver::new(Pipeline::new(&Config::default(), Start::Fresh).unwrap());
    driver.keep_sweeps();
    let mut link = Link::new(115_200);
    link.opened(Timestamp::default(), "test", &driver.reception());
    let mut board = OddBoard::new(oddity);
    let (mut troubles, mut resets, mut causes) = (Vec::new(), 0, Vec::new());
    let (mut rolled_m, mut longest_m, mut temperature_range_m) = (0.0, 0.0_f64, f64::NAN);
    board.run(seconds, |now_us, said| {
        let now = Timestamp::from_us(now_us);
        let mut frames = Vec::new();
        let mut observe = |update: Update<'_>| match update {
            Update::Event(Event::BoardTrouble { text, .. }) => troubles.push(text.clone()),
            Update::Event(Event::BoardReset { .. }) => resets += 1,
            Update::Transmit(frame) => frames.push(frame.clone()),
            _ => {}
        };
        driver.advance(now, |_, update| observe(update));
        if !said.is_empty() {
            driver.handle(Input::Received { at: now, bytes: said }, |_, update| observe(update));
            link.heard(now, said, &driver.reception());
        }
        link.tick(now, &driver.reception());
        for change in std::iter::from_fn(|| link.poll_change()) {
            if matches!(change.state, LinkState::Streaming | LinkState::Handshake) {
                causes.push(change.cause.to_string());
            }
        }
        for sweep in driver.take_sweeps() {
            rolled_m += sweep.left_m.abs();
            longest_m = longest_m.max(sweep.left_m.abs());
            temperature_range_m = sweep.beams[0].range_m;
        }
        for frame in &frames {
            driver.handle(Input::Sent { at: now, bytes: frame }, |_, _| {});
        }
        frames.concat()
    });
    let counters = driver.pipeline().counters();
    Met { troubles, resets, counters, causes, heard: board.heard(), rolled_m, longest_m, temperature_range_m }
}

/// One trouble with these words, no restart, and no flood of questions.
#[track_caller]
fn assert_named(met: &Met, words: &str, seconds: u32) {
    let Met { troubles, resets, heard: [starts, requests], .. } = met;
    assert_eq!(troubles.len(), 1, "{troubles:?}");
    assert!(troubles[0].contains(words), "{troubles:?}");
    assert_eq!(*resets, 0);
    assert!(*starts <= 2 + 4 * seconds && *requests <= 60 + 2 * seconds, "{starts} START, {requests} TIME_REQUEST");
}

fn metres(ticks: i64) -> f64 {
    TAU * Config::default().robot.wheel_radius_m * ticks as f64 / f64::from(TICKS_PER_TURN)
}

#[track_caller]
fn assert_rolled(met: &Met, seconds: i64) {
    let true_m = metres(TICKS_PER_S * (seconds - 2));
    assert!((met.rolled_m - true_m).abs() < 0.05, "{} m of {true_m} m", met.rolled_m);
    assert!(met.longest_m < 0.05, "a step of {} m", met.longest_m);
}

#[test]
fn a_board_without_mistakes_is_not_blamed() {
    let met = meet(Oddity::None, 40);
    assert_eq!(met.troubles, Vec::<String>::new());
    assert!(met.causes.last().unwrap().starts_with("test at"), "{:?}", met.causes);
    assert!(met.counters.sweeps > 390 && met.counters.refused_steps == 0, "{:?}", met.counters);
    assert_rolled(&met, 40);
}

#[test]
fn wheels_that_jump_are_bridged_and_named() {
    let met = meet(Oddity::Wraps, 40);
    assert_named(&met, "wraps at 16 bits", 40);
    assert_rolled(&met, 40);
    assert_eq!(met.counters.refused_steps, 0);
    let met = meet(Oddity::WrapsSigned, 40);
    assert_named(&met, "wraps at 16 bits", 40);
    assert_rolled(&met, 40);
    let met = meet(Oddity::StartsAnew, 20);
    assert_named(&met, "the counters start anew", 20);
    assert_rolled(&met, 20);
    let met = meet(Oddity::Zeros, 40);
    assert!(met.troubles.iter().all(|text| text.contains("and back")) && met.troubles.len() <= 5, "{:?}", met.troubles);
    assert!(met.counters.refused_steps > 10, "{:?}", met.counters);
    assert_rolled(&met, 40);
}

#[test]
fn groups_that_fire_slowly_are_no_trouble() {
    let met = meet(Oddity::SlowSlots, 60);
    assert_eq!(met.troubles, Vec::<String>::new());
    assert!(met.counters.sweeps > 50 && met.counters.dropped_sweeps == 0, "{:?}", met.counters);
}

#[test]
fn a_wrong_scale_is_named_once_and_used() {
    for scale in [4, 12] {
        let met = meet(Oddity::Scale(scale), 40);
        assert_named(&met, "above robot.max_speed_m_s (0.60): is robot.ticks_per_turn", 40);
        let true_m = metres(i64::from(scale) * TICKS_PER_S * 38);
        assert!((met.rolled_m / true_m - 1.0).abs() < 0.01, "{} m of {true_m} m", met.rolled_m);
    }
}

#[test]
fn a_clock_that_counts_milliseconds_is_understood() {
    let met = meet(Oddity::Milliseconds, 20);
    assert_named(&met, "counts milliseconds", 20);
    assert!(met.counters.sweeps > 185, "{:?}", met.counters);
    assert_rolled(&met, 20);
}

#[test]
fn a_clock_that_runs_back_is_named_and_its_stamps_are_not_used() {
    let met = meet(Oddity::RunsBack, 40);
    assert_named(&met, "clock runs backwards by 0.5 s", 40);
    // Five seconds of forty run back.
    assert!((310..360).contains(&met.counters.sweeps), "{:?}", met.counters);
    assert!((met.rolled_m - metres(TICKS_PER_S * 38)).abs() < 0.05, "{}", met.rolled_m);
    assert!(met.causes.last().unwrap().contains("clock runs backwards"), "{:?}", met.causes);
}

#[test]
fn prints_are_quoted_in_log_and_link() {
    let met = meet(Oddity::Prints, 10);
    assert_named(&met, "readable text between frames: `dist=23 cm`: take the prints out", 10);
    assert!(met.causes.last().unwrap().contains("`dist=23 cm`"), "{:?}", met.causes);
    assert!(met.counters.stray_texts > 80 && met.counters.sweeps > 50, "{:?}", met.counters);
}

#[test]
fn boards_that_give_no_sweep_are_named() {
    for (oddity, words) in [
        (Oddity::Mute, "does not say who it is (no HELLO)"),
        (Oddity::Ids, "echoes of sensor 100, but the ring has 8 sensors"),
        (Oddity::HalfAngles, "half_angle_cdeg of GEOMETRY is 9500"),
        (Oddity::Count, "the places of 9 sensors but says it has 8"),
    ] {
        let met = meet(oddity, 10);
        assert_named(&met, words, 10);
        assert!(met.causes.last().unwrap().contains(words), "{oddity:?}: {:?}", met.causes);
    }
}

#[test]
fn bearings_from_0_to_360_degrees_are_as_good_as_others() {
    let (usual, other) = (meet(Oddity::None, 10), meet(Oddity::Bearings, 10));
    assert_eq!(other.troubles, Vec::<String>::new());
    assert_eq!(other.counters.sweeps, usual.counters.sweeps);
}

#[test]
fn start_is_asked_again_after_300_ms_whatever_the_answer() {
    let met = meet(Oddity::Restarts, 10);
    assert!(met.counters.sweeps > 90 && met.heard[0] <= 2, "{:?}", met.heard);
    let met = meet(Oddity::NeverFires, 10);
    assert!((25..=34).contains(&met.heard[0]), "{:?}", met.heard);
}

#[test]
fn implausible_air_is_refused_and_named() {
    let (usual, hot) = (meet(Oddity::None, 10), meet(Oddity::Air(8_000), 10));
    assert_named(&hot, "air of 80.0 degrees, which is implausible; 20.0 is used", 10);
    assert!((usual.temperature_range_m - hot.temperature_range_m).abs() < 1e-9);
}

#[test]
fn a_robot_that_stands_is_waited_for() {
    let met = meet(Oddity::Rests, 30);
    assert_eq!(met.troubles, Vec::<String>::new());
    assert!(met.causes.last().unwrap().starts_with("waiting for movement"), "{:?}", met.causes);
    assert_eq!(met.causes.iter().filter(|cause| cause.starts_with("waiting")).count(), 1, "{:?}", met.causes);
}

#[test]
fn groups_that_overlap_and_sensors_that_answer_alike_are_named() {
    let met = meet(Oddity::Overlap, 20);
    assert_named(&met, "groups overlap", 20);
    assert!((185..=200).contains(&met.counters.sweeps), "{:?}", met.counters);
    assert_named(&meet(Oddity::Crosstalk, 30), "crosstalk, sensors", 30);
}
