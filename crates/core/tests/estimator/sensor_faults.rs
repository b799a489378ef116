//! A few of the drives of `cargo xtask sensor-faults`: broken sensors cost little, broken encoders are named, and no certain pose is wrong.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{EncoderState, LocalizationChange, SensorState, Wheel};
use slamd_testkit::broken::{Drive, Outcome};

fn with_encoder(fault: &str, seconds: f64) -> Outcome {
    Drive { encoder_faults: vec![fault.parse().unwrap()], ..Drive::flat(5, seconds) }.run()
}

/// The only verdict on an encoder: seconds, wheel and state.
fn verdict(outcome: &Outcome) -> (f64, Wheel, EncoderState) {
    let [told] = &outcome.encoders[..] else { panic!("{:?}", outcome.encoders) };
    println!("{:.1} s: {}", told.at.seconds(), told.reason);
    assert!(told.reason.contains(told.wheel.word()), "{}", told.reason);
    (told.at.seconds(), told.wheel, told.state)
}

#[test]
fn a_side_of_missing_sensors_and_eight_of_all_kinds_cost_little() {
    let whole = Drive::flat(5, 60.0).run();
    let kinds = ["saturated", "missing", "noisy", "stuck"];
    let eight: Vec<String> =
        kinds.iter().cycle().zip([2, 7, 11, 14, 19, 23, 26, 30]).map(|(kind, s)| format!("{s}:{kind}@20")).collect();
    let side: Vec<String> = (1..16).map(|sensor| format!("{sensor}:missing@20")).collect();
    for faults in [eight, side] {
        let sensor_faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        let broken = Drive { sensor_faults, ..Drive::flat(5, 60.0) }.run();
        println!("{faults:?}: {:.3} m, whole {:.3} m", broken.rms_m, whole.rms_m);
        for fault in &faults {
            let sensor: usize = fault.split(':').next().unwrap().parse().unwrap();
            let is_told =
                |sensor| broken.faults.iter().any(|told| told.sensor == sensor && told.state != SensorState::Healthy);
            assert!(is_told(sensor), "{fault} was not found");
        }
        let said = broken.covered(&whole).unwrap_or(1.0);
        assert!(!broken.is_worse_than(&whole) || said > 0.9, "{:.3} m", broken.rms_m);
    }
}

#[test]
fn a_reversed_encoder_is_named_and_its_sign_corrected() {
    let outcome = with_encoder("right:reversed@25", 60.0);
    let (at_s, wheel, state) = verdict(&outcome);
    assert_eq!((wheel, state), (Wheel::Right, EncoderState::Reversed));
    assert!((25.0..32.0).contains(&at_s), "{at_s} s");
    let last = outcome.locks.last().unwrap();
    assert!(matches!(last.change, LocalizationChange::Regained { .. }), "{:?}", outcome.locks);
    let last = outcome.sweeps.last().unwrap();
    assert!(last.error_m < 0.15, "{last:?} at the end");
}

#[test]
fn an_encoder_reversed_from_the_start_is_corrected_before_the_map_begins() {
    let outcome = with_encoder("left:reversed", 45.0);
    let (_, wheel, state) = verdict(&outcome);
    assert_eq!((wheel, state), (Wheel::Left, EncoderState::Reversed));
    assert!(outcome.sweeps.len() > 200, "{} poses", outcome.sweeps.len());
    assert!(outcome.worst_m < 0.15, "{} m", outcome.worst_m);
}

#[test]
fn a_dead_encoder_is_named_and_no_certain_pose_is_wrong() {
    let outcome = with_encoder("left:dead@25", 60.0);
    let (at_s, wheel, state) = verdict(&outcome);
    assert_eq!((wheel, state), (Wheel::Left, EncoderState::Dead));
    assert!((25.0..32.0).contains(&at_s), "{at_s} s");
    assert_eq!(outcome.locks.iter().map(|lock| &lock.change).collect::<Vec<_>>(), [&LocalizationChange::Lost]);
    assert!(outcome.worst_m > 0.5, "the drive shows nothing: {} m", outcome.worst_m);
    for told in &outcome.sweeps {
        assert!(told.error_m < 0.1 || told.is_uncertain, "{told:?} and said to be certain");
    }
    let blind: Vec<_> = outcome.sweeps.iter().skip_while(|told| told.two_sigma_m < 1.0).collect();
    assert!(blind.len() > 200, "{} sweeps said that they are uncertain", blind.len());
    for told in blind {
        assert!(told.is_uncertain && told.error_m < told.two_sigma_m, "{told:?}");
    }
}

#[test]
fn healthy_encoders_on_bad_wheels_are_not_declared_faulty() {
    let outcome = Drive { odometry_errors: 3.0, ..Drive::flat(6, 60.0) }.run();
    assert!(outcome.encoders.is_empty(), "{:?}", outcome.encoders);
}
