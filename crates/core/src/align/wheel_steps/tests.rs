//! Counts as boards send them, and the ticks that come of them.

use super::*;

/// 6.8 m to a 16-bit wrap.
const METRES: [f64; 2] = [1.0e-4; 2];
const MAX_M_S: f64 = 0.6;

/// Ticks of both wheels, and what was said, of counts read every 20 ms.
fn run(counts: impl IntoIterator<Item = [i32; 2]>) -> (Vec<[i64; 2]>, Vec<String>, WheelSteps) {
    let mut steps = WheelSteps::new(MAX_M_S, Params::default());
    let at = |index: u64| DeviceTime::from_us(1_000_000 + 20_000 * index);
    let ticks = (0..).zip(counts).map(|(index, counts)| steps.add(at(index), counts, METRES)).collect();
    let said = std::iter::from_fn(|| steps.take_trouble()).map(|trouble| trouble.to_string()).collect();
    (ticks, said, steps)
}

/// 0.3 m/s ahead, the right wheel a little faster.
fn drive(index: i32) -> [i32; 2] {
    [60 * index, 61 * index]
}

fn true_ticks(index: i64) -> [i64; 2] {
    [60 * index, 61 * index]
}

#[test]
fn counts_of_16_bits_are_unwrapped_and_said_once() {
    for wrap in [|count: i32| count & 0xFFFF, |count: i32| ((count + 0x8000) & 0xFFFF) - 0x8000] {
        for direction in [1, -1] {
            let (ticks, said, steps) = run((0..5_000).map(|index| drive(direction * index).map(wrap)));
            assert_eq!(ticks.last(), Some(&true_ticks(i64::from(direction) * 4_999)), "{said:?}");
            assert_eq!(said.len(), 1, "{said:?}");
            assert!(said[0].contains("16 bits"), "{said:?}");
            assert!(steps.counts().0 >= 8 && steps.counts().1 == 0, "{:?}", steps.counts());
        }
    }
}

#[test]
fn counts_of_32_bits_wrap_without_a_word() {
    let wrap = |count: i32| count.wrapping_add(i32::MAX - 3_000);
    let (ticks, said, _) = run((0..500).map(|index| drive(index).map(wrap)));
    assert_eq!(ticks.last(), Some(&true_ticks(499)));
    assert_eq!(said, Vec::<String>::new());
}

#[test]
fn counters_that_start_anew_cost_one_interval() {
    let (ticks, said, _) = run((0..500).map(|index| drive(if index < 300 { index } else { index - 300 })));
    for (ticks, truth) in ticks.last().unwrap().iter().zip(true_ticks(499)) {
        assert!(ticks.abs_diff(truth) <= 2, "{ticks} of {truth}");
    }
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(
        said[0].contains("the left wheel would have rolled -1.79 m in 0.02 s; the counters start anew"),
        "{said:?}"
    );
}

#[test]
fn a_counter_that_had_not_counted_far_starts_anew_with_the_other() {
    // A turn on the spot and back left the left wheel at 3 cm.
    let far = |index: i32| [300, 60 * index];
    let (ticks, said, _) = run((0..400).map(|index| if index < 300 { far(index) } else { [0, 60 * (index - 300)] }));
    assert_eq!(said.len(), 1, "{said:?}");
    let [left, right] = *ticks.last().unwrap();
    assert_eq!(left, 0, "the 3 cm back to zero were not rolled");
    assert!(right.abs_diff(60 * 399) <= 2, "{right}");
}

#[test]
fn one_wrong_value_costs_nothing() {
    for wrong in [0, 40_000, i32::MIN, i32::MAX] {
        let (ticks, said, steps) = run((0..500).map(|index| {
            let [left, right] = drive(index + 1_000);
            [if index == 300 { wrong } else { left }, right]
        }));
        assert_eq!(ticks.last(), Some(&true_ticks(499)), "{wrong}");
        assert!(ticks[300][0].abs_diff(true_ticks(300)[0]) <= 2, "{wrong}: {:?}", ticks[300]);
        assert_eq!((said.len(), steps.counts()), (1, (0, 1)), "{wrong}: {said:?}");
        assert!(said[0].contains("and back"), "{said:?}");
    }
}

#[test]
fn a_jump_to_another_count_is_refused_and_said() {
    let (ticks, said, _) = run((0..500).map(|index| {
        let [left, right] = drive(index);
        [if index < 300 { left } else { left + 500_000 }, right]
    }));
    let [left, right] = *ticks.last().unwrap();
    assert!(left.abs_diff(60 * 499) <= 2 && right == 61 * 499, "{left} {right}");
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("the left wheel would have rolled 50.01 m in 0.02 s"), "{said:?}");
}

#[test]
fn a_wrong_scale_is_said_once_and_used() {
    for factor in [4, 40] {
        let (ticks, said, _) = run((0..1_000).map(|index| drive(index).map(|count| factor * count)));
        let last = true_ticks(999).map(|ticks| i64::from(factor) * ticks);
        assert_eq!(ticks.last(), Some(&last), "{factor}: {said:?}");
        assert_eq!(said.len(), 1, "{factor}: {said:?}");
        assert!(said[0].contains("above robot.max_speed_m_s"), "{said:?}");
    }
    let (_, said, _) = run((0..1_000).map(drive));
    assert_eq!(said, Vec::<String>::new());
}

#[test]
fn noise_in_place_of_counts_rolls_nothing() {
    let noise = |index: i32| {
        let bits = index.wrapping_mul(-1_640_531_527);
        (bits ^ (bits >> 13)).wrapping_mul(1_540_483_477)
    };
    let (ticks, said, steps) = run((0..1_000).map(|index| [noise(index), noise(index + 7_000)]));
    assert!(ticks.iter().flatten().all(|ticks| ticks.abs() < 10_000), "{:?}", ticks.last());
    assert!((1..=20).contains(&said.len()) && steps.counts().1 > 300, "{said:?} {:?}", steps.counts());
}
