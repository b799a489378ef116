//! Rows of a ring CSV as they stand, and what is read out of all of them together: counts that are missing here and there, and
//! sensors that answer one after another, each in a row of its own.

use super::{ImportError, SourceLine};

/// One row.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Line of the file, from 1.
    pub(super) line: usize,
    pub(super) t_s: f64,
    /// Left and right encoder; none where the cell is empty.
    pub(super) ticks: [Option<i32>; 2],
    /// By sensor: metres, infinity for no echo, NaN for no measurement. Before [`Filler::clear`] also negative.
    pub(super) readings: Vec<f64>,
}

/// Columns of the left and the right encoder, from 0.
const TICK_COLUMNS: [usize; 2] = [1, 2];
/// Counts are interpolated over gaps up to here, seconds: the wheels' speed is taken as constant meanwhile.
const MAX_GAP_S: f64 = 2.0;

/// What fills missing cells of the encoders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Filled {
    /// Cells that were interpolated.
    pub(super) cells: u64,
    /// Rows without counts at the beginning or the end that were left out.
    pub(super) rows_left_out: u64,
}

/// Interpolates missing counts between those before and after. An encoder without a single count stands at 0: the robot has none.
/// Before its first count and after its last, a count is held for a while; rows farther out are left out.
///
/// # Errors
/// Where a gap is too long to be bridged and the wheel turned in it.
pub(super) fn fill_ticks(rows: &mut Vec<Row>, file: &str) -> Result<Filled, ImportError> {
    let mut filled = Filled::default();
    let mut is_far = vec![false; rows.len()];
    for (wheel, column) in TICK_COLUMNS.into_iter().enumerate() {
        let count = |row: &Row| row.ticks.get(wheel).copied().flatten();
        let known: Vec<(usize, f64, i32)> =
            rows.iter().enumerate().filter_map(|(index, row)| Some((index, row.t_s, count(row)?))).collect();
        if known.len() == rows.len() {
            continue;
        }
        let mut after = 0;
        for (index, (row, is_far)) in rows.iter_mut().zip(&mut is_far).enumerate() {
            while known.get(after).is_some_and(|(at, _, _)| *at <= index) {
                after += 1;
            }
            let previous = after.checked_sub(1).and_then(|at| known.get(at));
            let value = match (previous, known.get(after)) {
                (Some((at, _, _)), _) if *at == index => continue,
                (None, None) => 0,
                (Some((_, t_s, count)), None) | (None, Some((_, t_s, count))) => {
                    *is_far |= (row.t_s - t_s).abs() > MAX_GAP_S;
                    *count
                }
                (Some((_, from_s, from)), Some((_, to_s, to))) => {
                    if to_s - from_s > MAX_GAP_S && from != to {
                        let gap_s = to_s - from_s;
                        let expected = format!(
                            "a whole number of encoder ticks: {gap_s:.1} s without one, and the wheel turned meanwhile"
                        );
                        return Err(SourceLine { file, number: row.line }.error("", column, &expected));
                    }
                    between(*from, *to, (row.t_s - from_s) / (to_s - from_s))
                }
            };
            if let Some(cell) = row.ticks.get_mut(wheel) {
                *cell = Some(value);
            }
            filled.cells += u64::from(!known.is_empty());
        }
    }
    let mut is_far = is_far.into_iter();
    rows.retain(|_| {
        let is_out = is_far.next().unwrap_or_default();
        filled.rows_left_out += u64::from(is_out);
        !is_out
    });
    Ok(filled)
}

/// The count at a share of the way. Counters wrap.
#[expect(clippy::cast_possible_truncation, reason = "a share of a difference of 32 bits")]
fn between(from: i32, to: i32, share: f64) -> i32 {
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    from.wrapping_add((f64::from(to.wrapping_sub(from)) * share).round() as i32)
}

/// How a recording whose rows hold only the sensors that have just answered writes the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Filler {
    is_zero: bool,
    is_negative: bool,
}

impl Filler {
    /// Empty cells and NaN are no measurement in every recording.
    const ALL: [Self; 4] = [
        Self { is_zero: false, is_negative: false },
        Self { is_zero: true, is_negative: false },
        Self { is_zero: false, is_negative: true },
        Self { is_zero: true, is_negative: true },
    ];

    /// The filler of a recording whose rows hold a part of the ring each; none if its rows are whole sweeps.
    pub(super) fn find(rows: &[Row]) -> Option<Self> {
        Self::ALL.into_iter().find(|filler| filler.takes_turns(rows))
    }

    /// True if rows hold at most half of the ring and neighbouring rows nearly always hold different sensors.
    fn takes_turns(self, rows: &[Row]) -> bool {
        let sensors = rows.first().map_or(0, |row| row.readings.len());
        let sets: Vec<u128> = rows.iter().map(|row| self.heard(row)).filter(|set| *set != 0).collect();
        let heard: usize = sets.iter().map(|set| set.count_ones() as usize).sum();
        let all = sets.iter().fold(0, |all, set| all | set);
        let changes = sets.windows(2).filter(|pair| matches!(pair, [a, b] if a & b == 0)).count();
        sets.len() >= sensors.max(4)
            && 2 * heard <= sensors * sets.len()
            && 2 * all.count_ones() as usize > sensors
            && changes as f64 >= MIN_CHANGES * sets.len().saturating_sub(1) as f64
    }

    /// The sensors that answered in a row, a bit each.
    pub(super) fn heard(self, row: &Row) -> u128 {
        let bits = (0u32..).zip(&row.readings).filter(|(_, reading)| !self.fills(**reading));
        bits.fold(0, |set, (sensor, _)| set | 1u128.checked_shl(sensor).unwrap_or_default())
    }

    pub(super) fn fills(self, reading: f64) -> bool {
        reading.is_nan() || (self.is_zero && reading == 0.0) || (self.is_negative && reading < 0.0)
    }

    /// Makes every filling cell "no measurement".
    pub(super) fn clear(self, rows: &mut [Row]) {
        for reading in rows.iter_mut().flat_map(|row| &mut row.readings) {
            if self.fills(*reading) {
                *reading = f64::NAN;
            }
        }
    }
}

/// Share of neighbouring rows with different sensors from which on sensors are said to take turns.
const MIN_CHANGES: f64 = 0.8;
/// A cycle is over where rows are so many times farther apart than half of them are.
const PAUSE: f64 = 5.0;

/// By row: true if it is the last of its cycle, so that the next begins a sweep. A cycle is over when all sensors have answered, when
/// one answers again, or at a pause.
pub(super) fn cycle_ends(rows: &[Row], filler: Filler) -> Vec<bool> {
    let all = rows.iter().fold(0, |all, row| all | filler.heard(row));
    let mut steps_s: Vec<f64> = rows.windows(2).map(step_s).collect();
    steps_s.sort_by(f64::total_cmp);
    let pause_s = PAUSE * steps_s.get(steps_s.len() / 2).copied().unwrap_or(f64::INFINITY);
    let mut cycle = 0;
    let mut ends = Vec::with_capacity(rows.len());
    for (index, row) in rows.iter().enumerate() {
        cycle |= filler.heard(row);
        let pair = rows.get(index..).and_then(|rest| rest.get(..2));
        let next = pair.and_then(<[Row]>::last).map_or(0, |next| filler.heard(next));
        let is_end = cycle == all || cycle & next != 0 || pair.is_none_or(|pair| step_s(pair) > pause_s);
        if is_end {
            cycle = 0;
        }
        ends.push(is_end);
    }
    ends
}

fn step_s(pair: &[Row]) -> f64 {
    pair.last().zip(pair.first()).map_or(0.0, |(last, first)| last.t_s - first.t_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(t_s: f64, left: Option<i32>, readings: &[f64]) -> Row {
        Row { line: 2, t_s, ticks: [left, Some(0)], readings: readings.to_vec() }
    }

    fn left(rows: &[Row]) -> Vec<i32> {
        rows.iter().map(|row| row.ticks[0].unwrap()).collect()
    }

    #[test]
    fn missing_counts_lie_between_their_neighbours() {
        let counts = [None, Some(10), None, None, Some(40), Some(i32::MAX), None, Some(i32::MIN + 1), None];
        let rows: Vec<Row> = (0u8..).zip(counts).map(|(k, count)| row(0.1 * f64::from(k), count, &[])).collect();
        let mut near = rows.clone();
        assert_eq!(fill_ticks(&mut near, "a.csv").unwrap(), Filled { cells: 5, rows_left_out: 0 });
        assert_eq!(left(&near), [10, 10, 20, 30, 40, i32::MAX, i32::MIN, i32::MIN + 1, i32::MIN + 1]);
        let mut none: Vec<Row> = rows.iter().map(|row| Row { ticks: [None, Some(0)], ..row.clone() }).collect();
        assert_eq!(fill_ticks(&mut none, "a.csv").unwrap(), Filled::default());
        assert_eq!(left(&none), [0; 9]);
    }

    #[test]
    fn a_long_gap_is_an_error_where_the_wheel_turned() {
        let gap = |end| {
            let mut rows = vec![row(0.0, Some(5), &[]), row(1.0, None, &[]), row(3.0, Some(end), &[])];
            fill_ticks(&mut rows, "a.csv").map(|_| left(&rows))
        };
        assert_eq!(gap(5).unwrap(), [5, 5, 5]);
        let error = gap(900).unwrap_err().to_string();
        assert!(error.contains("a.csv: line 2, column 2") && error.contains("3.0 s without one"), "{error}");
        let mut rows = vec![row(0.0, None, &[]), row(2.5, None, &[]), row(3.0, Some(7), &[]), row(9.0, None, &[])];
        assert_eq!(fill_ticks(&mut rows, "a.csv").unwrap(), Filled { cells: 3, rows_left_out: 2 });
        assert_eq!(left(&rows), [7, 7]);
    }

    /// Rows of a ring of six in which sensors take turns in an order, the others filled.
    fn turns(order: &[&[usize]], filler: f64) -> Vec<Row> {
        let one = |k: usize| {
            let mut readings = [filler; 6];
            order[k % order.len()].iter().for_each(|&sensor| readings[sensor] = 1.0 + 0.1 * sensor as f64);
            row(0.05 * k as f64, Some(0), &readings)
        };
        (0..24).map(one).collect()
    }

    #[test]
    fn sensors_that_take_turns_are_collected() {
        for filler in [f64::NAN, 0.0, -1.0] {
            for order in [[&[0][..], &[1], &[2], &[3], &[4], &[5]], [&[5], &[0], &[3], &[1], &[4], &[2]]] {
                let rows = turns(&order, filler);
                let found = Filler::find(&rows).unwrap();
                let ends: Vec<usize> = (0..24).filter(|&k| cycle_ends(&rows, found)[k]).collect();
                assert_eq!(ends, [5, 11, 17, 23]);
            }
            let pairs = turns(&[&[0, 3], &[1, 4], &[2, 5]], filler);
            let found = Filler::find(&pairs).unwrap();
            assert_eq!(cycle_ends(&pairs, found).iter().filter(|end| **end).count(), 8);
        }
    }

    #[test]
    fn whole_sweeps_are_not_collected() {
        assert_eq!(Filler::find(&turns(&[&[0, 1, 2, 3, 4, 5]], f64::NAN)), None);
        // Two sensors that see a wall, the others without an echo.
        assert_eq!(Filler::find(&turns(&[&[0, 1]], 0.0)), None);
        assert_eq!(Filler::find(&turns(&[&[0, 1, 2, 3], &[2, 3, 4, 5]], f64::NAN)), None);
    }

    #[test]
    fn a_lost_row_or_a_pause_ends_a_cycle() {
        let mut rows = turns(&[&[0], &[1], &[2], &[3], &[4], &[5]], f64::NAN);
        rows.iter_mut().skip(8).for_each(|row| row.t_s += 60.0);
        let ends = cycle_ends(&rows, Filler::default());
        assert!(ends[5] && ends[7] && !ends[6]);
    }
}
