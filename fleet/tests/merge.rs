//! Whatever order maps come in, however often, from whichever source: the same bytes.

#![allow(clippy::unwrap_used, reason = "a test may")]

use proptest::prelude::*;
use slamd_core::Pose2;
use slamd_fleet::merge::{Merged, Newest, Placement};
use slamd_fleet::name::Name;
use slamd_fleet::session::SessionId;
use slamd_fleet::wire::{Grid, Start, TILE, Tile};

const ROBOTS: [(&str, [f64; 3]); 3] =
    [("attic", [4.0, -1.2, 1.57]), ("hall", [0.0, 0.0, 0.4]), ("kitchen", [-2.013, 3.3, -2.9])];

/// The map of a robot at a session and number: a function of them, as a replay is.
fn grid(robot: usize, session: u8, seq: u8) -> Grid {
    let mut number = 1_000_003 * (robot as u64 + 1) + 7919 * u64::from(session) + u64::from(seq);
    let mut log_odds = Vec::with_capacity(TILE);
    for _ in 0..TILE {
        number = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        log_odds
            .push(i16::try_from(number >> 33).map_or(0, |value| value).max(i16::try_from(number % 721).unwrap() - 320));
    }
    log_odds.iter_mut().for_each(|value| *value = (*value).clamp(-320, 400));
    let tiles = vec![Tile { column: i32::from(seq % 3) - 1, row: 0, log_odds }];
    let session: SessionId = format!("{session:020}-00000000").parse().unwrap();
    Grid { session, seq: seq.into(), start: Start::default(), cell_um: 50_000, tiles }
}

fn merged(arrivals: impl IntoIterator<Item = (usize, u8, u8)>) -> Vec<u8> {
    let mut newest = Newest::default();
    for (robot, session, seq) in arrivals {
        newest.take(&ROBOTS[robot].0.parse::<Name>().unwrap(), grid(robot, session, seq));
    }
    let mut merged = Merged::new(50_000);
    for (name, grid) in newest.iter() {
        let [x, y, theta] = ROBOTS.iter().find(|(robot, _)| *robot == name.as_ref()).unwrap().1;
        merged.add(grid, &Placement::new(Pose2::new(x, y, theta)));
    }
    merged.encode()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Some maps are lost on the way and come again at the end, from the captures: order and repetitions are free.
    #[test]
    fn order_repetition_and_loss_with_refill_change_nothing(
        (sent, arrivals) in prop::collection::vec((0..3usize, 0..3u8, 0..4u8), 1..12).prop_flat_map(|sent| {
            let repeated = prop::collection::vec(prop::sample::select(sent.clone()), 0..12);
            let shuffled = Just(sent.clone()).prop_shuffle();
            (Just(sent), (repeated, shuffled).prop_map(|(lost_and_doubled, refilled)| [lost_and_doubled, refilled].concat()))
        })
    ) {
        prop_assert_eq!(merged(sent), merged(arrivals));
    }

    /// A map that is older than the newest one never counts, whenever it comes.
    #[test]
    fn only_the_newest_counts(robot in 0..3usize, session in 1..4u8, seq in 1..9u8, late in 0..9u8) {
        let newest = merged([(robot, session, seq)]);
        prop_assert_eq!(&merged([(robot, session, seq), (robot, session - 1, late)]), &newest);
        prop_assert_eq!(&merged([(robot, session, seq - 1), (robot, session, seq)]), &newest);
    }
}

#[test]
fn what_is_missing_is_noticed() {
    assert_ne!(merged([(0, 1, 1), (1, 1, 1)]), merged([(0, 1, 1)]));
    assert_ne!(merged([(0, 1, 2)]), merged([(0, 1, 1)]));
}
