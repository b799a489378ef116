//! Where am I? A short version of `cargo xtask localize`.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::known_building::{remember, seek};

#[test]
fn a_known_flat_is_recognised() {
    let known = remember("flat", 1, 300.0);
    let outcome = seek(&known, "flat", 1, 75.0);
    println!("worst {:.2} m: {:?}", outcome.worst_m, outcome.said);
    assert!(outcome.said[0].starts_with("position unknown"), "{outcome:?}");
    assert!(outcome.found_after_s.is_some_and(|seconds| seconds <= 60.0), "{outcome:?}");
    assert!(!outcome.is_wrong(), "{outcome:?}");
}

#[test]
fn a_symmetrical_room_is_not_guessed_at() {
    let known = remember("symmetrical", 2, 90.0);
    let outcome = seek(&known, "symmetrical", 2, 80.0);
    println!("{:?}", outcome.said);
    assert_eq!((outcome.found_after_s, outcome.sweeps), (None, 0.0));
    assert!(outcome.said.iter().any(|said| said.contains("two places explain")), "{:?}", outcome.said);
}

#[test]
fn another_building_is_not_taken_for_the_known_one() {
    let known = remember("flat", 3, 240.0);
    let outcome = seek(&known, "furnished", 3, 80.0);
    println!("{:?}", outcome.said);
    assert_eq!(outcome.found_after_s, None);
    assert!(outcome.said.last().unwrap().contains("still unknown after"), "{:?}", outcome.said);
}
