//! Encoder cells as recordings have them: whole numbers of 32 or 64 bits, decimal fractions, or ticks since the row before.

use super::rows::Row;
use std::f64::consts::TAU;
use std::str::FromStr;

/// How a recording counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counting {
    /// Ticks since the start.
    Counts,
    /// Ticks since the row before.
    Deltas,
    /// Metres that a wheel has rolled since the start.
    Metres,
    /// The same in millimetres.
    Millimetres,
    /// Turns of a wheel since the start.
    Turns,
    /// The same in radians.
    Radians,
    /// The same in degrees.
    Degrees,
}

impl Counting {
    /// How many ticks one of a cell's is; none if cells are ticks.
    pub(super) const fn ticks(self, metres_per_tick: f64, ticks_per_turn: f64) -> Option<f64> {
        match self {
            Self::Counts | Self::Deltas => None,
            Self::Metres => Some(1.0 / metres_per_tick),
            Self::Millimetres => Some(1e-3 / metres_per_tick),
            Self::Turns => Some(ticks_per_turn),
            Self::Radians => Some(ticks_per_turn / TAU),
            Self::Degrees => Some(ticks_per_turn / 360.0),
        }
    }
}

impl FromStr for Counting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "counts" => Ok(Self::Counts),
            "deltas" => Ok(Self::Deltas),
            "metres" | "m" => Ok(Self::Metres),
            "millimetres" | "mm" => Ok(Self::Millimetres),
            "turns" => Ok(Self::Turns),
            "radians" | "rad" => Ok(Self::Radians),
            "degrees" | "deg" => Ok(Self::Degrees),
            _ => {
                Err("it must be counts or deltas, or metres, millimetres, turns, radians or degrees of a wheel".into())
            }
        }
    }
}

/// A row's cells, and its time.
pub(super) struct Cells {
    pub(super) t_s: f64,
    pub(super) ticks: [Option<f64>; 2],
}

/// As deltas the robot must have driven so far before they are taken as such without being asked for, metres.
const MIN_WAY_M: f64 = 2.0;
/// As counts it would have stayed within this share of the way.
const MAX_RANGE: f64 = 0.05;
/// A share of the rows may be too fast.
const MIN_SLOW: f64 = 0.99;
/// Neighbouring cells differ at least this often: a robot that stands has one count.
const MIN_CHANGES: f64 = 0.3;

/// A counter of 8 bits has this many values, and uses nearly all of them.
const VALUES_OF_8_BITS: f64 = 256.0;
const MIN_SPREAD: f64 = 240.0;
/// Steps by more than half of the values are wraps, if they are at least this share of the steps: ticks since the row before change
/// slowly.
const MIN_WRAP_SHARE: f64 = 0.03;
/// Steps by nearly all values are wraps, however rare.
const FULL_WRAP: f64 = 200.0;
const MIN_WRAPS: usize = 2;

/// True if an encoder has the whole numbers of a counter of 8 bits, with or without a sign, which wraps.
pub(super) fn wraps_at_8_bits(cells: &[Cells]) -> bool {
    [0, 1].into_iter().any(|wheel| {
        let known: Vec<f64> = cells.iter().filter_map(|cells| *cells.ticks.get(wheel)?).collect();
        let least = known.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let is_byte = (least >= 0.0 && greatest < VALUES_OF_8_BITS)
            || (least >= -0.5 * VALUES_OF_8_BITS && greatest < 0.5 * VALUES_OF_8_BITS);
        let steps = || known.windows(2).filter_map(|pair| Some((pair.last()? - pair.first()?).abs()));
        let wraps = steps().filter(|step| *step > 0.5 * VALUES_OF_8_BITS).count();
        let full = steps().filter(|step| *step >= FULL_WRAP).count();
        is_byte
            && greatest - least >= MIN_SPREAD
            && known.iter().all(|count| count.fract() == 0.0)
            && wraps >= MIN_WRAPS
            && (wraps as f64 >= MIN_WRAP_SHARE * known.len() as f64 || full == wraps)
    })
}

/// What the cells are: as told, or as found. `metres_per_tick` and the greatest speed, m/s, are those of the robot.
pub(super) fn find(cells: &[Cells], metres_per_tick: f64, max_speed_m_s: f64) -> Counting {
    let is_deltas = [0, 1].into_iter().all(|wheel| {
        let known: Vec<(f64, f64)> =
            cells.iter().filter_map(|cells| Some((cells.t_s, (*cells.ticks.get(wheel)?)? * metres_per_tick))).collect();
        let pairs = || known.windows(2).filter_map(|pair| Some((pair.first()?, pair.last()?)));
        let slow = pairs().filter(|((before_s, _), (at_s, cell_m))| cell_m.abs() <= max_speed_m_s * (at_s - before_s));
        let changes = pairs().filter(|((_, before), (_, cell))| before.total_cmp(cell).is_ne());
        let way_m: f64 = known.iter().map(|(_, cell_m)| cell_m.abs()).sum();
        let least_m = known.iter().map(|(_, cell_m)| *cell_m).fold(f64::INFINITY, f64::min);
        let greatest_m = known.iter().map(|(_, cell_m)| *cell_m).fold(f64::NEG_INFINITY, f64::max);
        let steps = known.len().saturating_sub(1) as f64;
        way_m >= MIN_WAY_M
            && slow.count() as f64 >= MIN_SLOW * steps
            && changes.count() as f64 >= MIN_CHANGES * steps
            && greatest_m - least_m <= MAX_RANGE * way_m
    });
    if is_deltas { Counting::Deltas } else { Counting::Counts }
}

/// Sums deltas. A missing one is as its neighbours are.
pub(super) fn sum(cells: &mut [Cells]) {
    for wheel in [0, 1] {
        let given: Vec<Option<f64>> = cells.iter().map(|cells| cells.ticks.get(wheel).copied().flatten()).collect();
        if given.iter().all(Option::is_none) {
            continue;
        }
        let mut count = 0.0;
        for (index, cells) in cells.iter_mut().enumerate() {
            let before = given.get(..index).and_then(|before| before.iter().rev().copied().flatten().next());
            let after = given.get(index..).and_then(|after| after.iter().copied().flatten().next());
            let mean = before.zip(after).map(|(before, after)| 0.5 * (before + after));
            count += given.get(index).copied().flatten().or(mean).unwrap_or_default();
            if let Some(cell) = cells.ticks.get_mut(wheel) {
                *cell = Some(count);
            }
        }
    }
}

/// A count as a board's 32-bit counter has it: it wraps.
#[expect(clippy::cast_possible_truncation, reason = "the low 32 bits are meant")]
pub(super) fn wrapped(count: f64) -> i32 {
    count.round() as i64 as i32
}

/// Puts the counts into the rows.
pub(super) fn fill(rows: &mut [Row], cells: &[Cells]) {
    for (row, cells) in rows.iter_mut().zip(cells) {
        row.ticks = cells.ticks.map(|ticks| ticks.map(wrapped));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const METRES_PER_TICK: f64 = 1.5e-4;

    fn cells(left: impl Fn(f64) -> f64) -> Vec<Cells> {
        let cell = |k: u32| Cells { t_s: 0.1 * f64::from(k), ticks: [Some(left(f64::from(k))); 2] };
        (0..300).map(cell).collect()
    }

    fn found(left: impl Fn(f64) -> f64) -> Counting {
        find(&cells(left), METRES_PER_TICK, 1.0)
    }

    #[test]
    fn deltas_are_told_from_counts() {
        assert_eq!(found(|k| (150.0 + 30.0 * libm::sin(0.3 * k)).round()), Counting::Deltas);
        assert_eq!(found(|k| (150.0 * k).round()), Counting::Counts);
        assert_eq!(found(|k| 4_294_966_796.0 + 150.0 * k), Counting::Counts);
        // A robot that stands, and one that trembles.
        assert_eq!(found(|_| 500.0), Counting::Counts);
        assert_eq!(found(|k| 500.0 + if k % 10.0 < 0.5 { 1.0 } else { 0.0 }), Counting::Counts);
        // Half a metre forth and back.
        assert_eq!(found(|k| (3_000.0 * libm::sin(0.05 * k)).round()), Counting::Counts);
    }

    #[test]
    fn counters_of_8_bits_are_told_from_deltas_and_counts() {
        for step in [2.0, 10.0, 60.0, 106.0, 150.0, -37.0] {
            let byte = |k: f64| (step * k + 20.0 * libm::sin(0.1 * k)).round().rem_euclid(256.0);
            assert!(wraps_at_8_bits(&cells(byte)), "{step}");
            assert!(wraps_at_8_bits(&cells(|k| byte(k) - 128.0)), "{step}");
            assert!(!wraps_at_8_bits(&cells(|k| (step * k).round())), "{step}");
        }
        // Ticks since the row before, up to those of a byte.
        assert!(!wraps_at_8_bits(&cells(|k| (127.0 + 127.0 * libm::sin(0.1 * k)).round())));
        assert!(!wraps_at_8_bits(&cells(|k| (127.0 * libm::sin(0.3 * k)).round())));
        assert!(!wraps_at_8_bits(&cells(|k| if k % 40.0 < 25.0 { 160.0 } else { 60.0 })));
    }

    #[test]
    fn deltas_are_summed_and_missing_ones_are_as_their_neighbours() {
        let mut rows: Vec<Cells> = [Some(0.5), Some(2.0), None, Some(4.0), Some(-1.5)]
            .into_iter()
            .map(|left| Cells { t_s: 0.0, ticks: [left, None] })
            .collect();
        sum(&mut rows);
        assert_eq!(rows.iter().map(|row| row.ticks[0].unwrap()).collect::<Vec<_>>(), [0.5, 2.5, 5.5, 9.5, 8.0]);
        assert!(rows.iter().all(|row| row.ticks[1].is_none()));
    }

    #[test]
    fn counts_of_any_width_wrap() {
        assert_eq!(wrapped(4_294_966_796.0), -500);
        assert_eq!(wrapped(-3.4), -3);
        assert_eq!(wrapped(f64::from(i32::MAX) + 1.0), i32::MIN);
        assert_eq!(wrapped((1u64 << 40) as f64 + 7.0), 7);
    }
}
