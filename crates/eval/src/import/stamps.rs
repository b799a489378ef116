//! Time stamps as recordings have them: single wrong ones, clocks that step or start anew, pauses, several runs in one file.
//!
//! Stamps that are out of order while the later ones go on are interpolated. Where all later ones are out of order, the clock has
//! stepped, and they follow on; or another run begins, where also the counts start anew and the ranges are those of another location.

use super::rows::Row;
use super::sequence::typical_step_s;
use super::times;

/// What has been found, and the session's begin.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    /// What was changed, each with its line.
    pub(super) remarks: Vec<String>,
    /// Unix time of the first row, microseconds, where stamps are times of the day.
    pub(super) unix_zero_us: Option<u64>,
}

/// A gap is ordinary up to so many typical steps and so many seconds.
const REACH_STEPS: f64 = 10.0;
const REACH_S: f64 = 2.0;
/// So many stamps in a row may be wrong.
const MAX_WRONG: usize = 5;
/// Longer gaps are said.
const PAUSE_S: f64 = 60.0;
/// A clock that goes forward by more has been set.
const MAX_PAUSE_S: f64 = 86_400.0;
/// Stamps of the calendar: from September 2001 to 2286.
const EPOCH_S: std::ops::Range<f64> = 1e9..1e10;
const MAX_REMARKS: usize = 5;
/// A row whose counts differ by no more than the wheels can roll in so many typical steps goes on from the row before.
const ROLLING_STEPS: f64 = 5.0;
/// Two rows are of one location if most of their ranges differ by no more.
const SAME_M: f64 = 0.15;
/// Rows with ranges are sought so far on both sides: each step of the clock seeks them, and there may be as many as rows.
const MAX_SOUGHT: usize = 1_000;

/// What a wheel can do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wheel {
    /// Ticks per second at the robot's greatest speed.
    pub(super) max_ticks_per_s: f64,
    /// The recording has ticks since the row before.
    pub(super) is_deltas: bool,
}

/// Puts the rows' times in order. `run` is the run to keep where there are several, from 1.
///
/// # Errors
/// Where there is no such run. The text says how many there are.
pub(super) fn repair(rows: &mut Vec<Row>, wheel: Wheel, run: Option<usize>) -> Result<Stamps, String> {
    let stamps = Stamps::default();
    let typical_s = typical_step_s(rows);
    let mut walk =
        Walk { rows, wheel, typical_s, offset_s: 0.0, stamps, wrong: Vec::new(), steps: Vec::new(), starts: vec![0] };
    walk.all();
    let Walk { mut stamps, wrong, steps, starts, .. } = walk;
    say_steps(&steps, rows.len(), &mut stamps);
    say_wrong(&wrong, &mut stamps);
    let (count, chosen) = (starts.len(), run.unwrap_or(1));
    let lines: Vec<String> =
        starts.iter().skip(1).filter_map(|start| Some(format!("line {}", rows.get(*start)?.line))).collect();
    if !(1..=count).contains(&chosen) {
        let runs = if lines.is_empty() {
            "1 run".into()
        } else {
            format!("{count} runs; after the first they begin in {}", lines.join(", "))
        };
        return Err(format!("--run {chosen}: the recording has {runs}"));
    }
    if count > 1 {
        stamps.remarks.push(format!(
            "{}: another run begins here: the time starts anew, and the robot stands elsewhere; run {chosen} of {count} is imported, --run takes another",
            lines.join(", ")
        ));
        let end = starts.get(chosen).copied().unwrap_or(rows.len());
        let start = chosen.checked_sub(1).and_then(|index| starts.get(index)).copied().unwrap_or_default();
        rows.truncate(end);
        rows.drain(..start.min(rows.len()));
    }
    Ok(stamps)
}

struct Walk<'a> {
    rows: &'a mut Vec<Row>,
    wheel: Wheel,
    typical_s: f64,
    /// What is added to the recording's clock, seconds.
    offset_s: f64,
    stamps: Stamps,
    /// Lines whose stamps were interpolated, and what they said.
    wrong: Vec<(usize, f64)>,
    /// Lines where the clock steps, and by how much, seconds.
    steps: Vec<(usize, f64)>,
    /// The first row of each run.
    starts: Vec<usize>,
}

impl Walk<'_> {
    fn all(&mut self) {
        self.first();
        self.epoch(0);
        let mut index = 1;
        while index < self.rows.len() {
            index = self.row(index);
        }
    }

    fn raw(&self, index: usize) -> f64 {
        self.rows.get(index).map_or(f64::NAN, |row| row.t_s)
    }

    fn reach_s(&self) -> f64 {
        (REACH_STEPS * self.typical_s).max(REACH_S)
    }

    fn is_step(&self, step_s: f64) -> bool {
        (0.0..=self.reach_s()).contains(&step_s)
    }

    /// A first stamp that does not belong to the next ones.
    fn first(&mut self) {
        let [a, b, c] = [0, 1, 2].map(|index| self.raw(index));
        if !self.is_step(b - a) && self.is_step(c - b) && (self.raw(3).is_nan() || self.is_step(self.raw(3) - c)) {
            let is_pause = b - a > 0.0 && b - a <= MAX_PAUSE_S;
            if let (Some(row), false) = (self.rows.first_mut(), is_pause) {
                self.wrong.push((row.line, a));
                row.t_s = b - self.typical_s;
            }
        }
    }

    /// Sets the time of a row from its own stamp or the ones around it. Returns the next row.
    fn row(&mut self, index: usize) -> usize {
        let last_s = self.raw(index - 1);
        let step_s = self.raw(index) + self.offset_s - last_s;
        if self.is_step(step_s) {
            self.set(index, last_s + step_s);
            return index + 1;
        }
        if let Some(next) = self.goes_on(index, last_s) {
            let to_s = self.raw(next) + self.offset_s;
            for (share, wrong) in (1u32..).zip(index..next) {
                let steps = f64::from(share) / (next - index + 1) as f64;
                self.wrong.push((self.rows.get(wrong).map_or(0, |row| row.line), self.raw(wrong)));
                self.set(wrong, last_s + steps * (to_s - last_s));
            }
            return next;
        }
        self.step(index, last_s, step_s);
        index + 1
    }

    /// The next row that goes on from the last right one, if the rows between are wrong each for itself.
    fn goes_on(&self, index: usize, last_s: f64) -> Option<usize> {
        let next = (index + 1..=index + MAX_WRONG).find(|next| {
            let step_s = self.raw(*next) + self.offset_s - last_s;
            step_s > 0.0 && self.is_step(step_s)
        })?;
        // Rows that follow each other on another time are a step of the clock.
        let together = (index + 1..next).all(|row| self.is_step(self.raw(row) - self.raw(row - 1)));
        (next == index + 1 || !together).then_some(next)
    }

    /// All later stamps are out of order.
    fn step(&mut self, index: usize, last_s: f64, step_s: f64) {
        let line = self.rows.get(index).map_or(0, |row| row.line);
        if step_s > 0.0 && step_s <= MAX_PAUSE_S {
            if step_s > PAUSE_S {
                self.stamps.remarks.push(format!("line {line}: a pause of {step_s:.0} s"));
            }
            self.set(index, last_s + step_s);
        } else if step_s < 0.0 && self.is_another_run(index) {
            self.starts.push(index);
            self.offset_s = 0.0;
        } else {
            // A stamp that is no number is no step.
            let raw_s = self.raw(index);
            let at_s = last_s + self.typical_s;
            if raw_s.is_nan() {
                self.wrong.push((line, raw_s));
            } else {
                self.steps.push((line, step_s - self.typical_s));
                self.offset_s = at_s - raw_s;
                self.epoch_after_step(raw_s, at_s);
            }
            self.set(index, at_s);
        }
    }

    /// True if also the counts start anew, and the ranges are those of another location.
    fn is_another_run(&self, index: usize) -> bool {
        let (Some(before), Some(after)) = (self.rows.get(index - 1), self.rows.get(index)) else { return false };
        let most = ROLLING_STEPS * self.typical_s * self.wheel.max_ticks_per_s;
        let rolls = before.ticks.iter().zip(&after.ticks).all(|pair| match pair {
            (Some(before), Some(after)) => f64::from(after.wrapping_sub(*before)).abs() <= most,
            _ => true,
        });
        (self.wheel.is_deltas || !rolls) && !is_same_location(self.rows, index)
    }

    fn set(&mut self, index: usize, t_s: f64) {
        self.rows.get_mut(index).into_iter().for_each(|row| row.t_s = t_s);
    }

    fn epoch(&mut self, index: usize) {
        let at_s = self.raw(index);
        if EPOCH_S.contains(&at_s) {
            self.stamps.unix_zero_us = micros(at_s);
        }
    }

    /// A clock that was set to the calendar's time while the recording went on.
    fn epoch_after_step(&mut self, raw_s: f64, at_s: f64) {
        let begin_s = raw_s - (at_s - self.raw(0));
        if self.stamps.unix_zero_us.is_none() && EPOCH_S.contains(&begin_s) {
            self.stamps.unix_zero_us = micros(begin_s);
        }
    }
}

/// A clock that steps in so many of the rows runs backwards, or the rows do.
const REVERSED: f64 = 0.5;

fn say_steps(steps: &[(usize, f64)], rows: usize, stamps: &mut Stamps) {
    if steps.len() <= MAX_REMARKS {
        for (line, step_s) in steps {
            stamps.remarks.push(format!("line {line}: {}; the rows after it follow on", times::step(*step_s)));
        }
    } else if let (Some((first, _)), Some((last, _))) = (steps.first(), steps.last()) {
        let count = steps.len();
        let is_reversed = steps.iter().filter(|(_, step_s)| *step_s < 0.0).count() as f64 >= REVERSED * rows as f64;
        let question = if is_reversed { ": are the rows in reverse order? Sort them by their time" } else { "" };
        stamps.remarks.push(format!(
            "lines {first} to {last}: the clock steps {count} times; the rows after each step follow on{question}"
        ));
    }
}

fn say_wrong(wrong: &[(usize, f64)], stamps: &mut Stamps) {
    for (line, t_s) in wrong.iter().take(MAX_REMARKS) {
        let found = if t_s.is_nan() { "no stamp".into() } else { format!("t_s = {t_s} is out of order") };
        stamps.remarks.push(format!("line {line}: {found}; the time is interpolated"));
    }
    if wrong.len() > MAX_REMARKS {
        stamps.remarks.push(format!("{} stamps were interpolated", wrong.len()));
    }
}

/// True if most sensors measure the same before a row and from it on.
fn is_same_location(rows: &[Row], index: usize) -> bool {
    let (before, after) = rows.split_at(index.min(rows.len()));
    let heard = |row: &&Row| row.readings.iter().any(|reading| reading.is_finite());
    let before = before.iter().rev().take(MAX_SOUGHT).find(heard);
    let Some((before, after)) = before.zip(after.iter().take(MAX_SOUGHT).find(heard)) else { return true };
    let pairs = before.readings.iter().zip(&after.readings);
    let both: Vec<bool> = pairs
        .filter(|(before, after)| before.is_finite() && after.is_finite())
        .map(|(before, after)| (before - after).abs() <= SAME_M)
        .collect();
    2 * both.iter().filter(|same| **same).count() >= both.len()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the calendar's range")]
fn micros(at_s: f64) -> Option<u64> {
    EPOCH_S.contains(&at_s).then(|| (at_s * 1e6).round() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEEL: Wheel = Wheel { max_ticks_per_s: 6_500.0, is_deltas: false };

    /// A drive of 0.1 s steps whose ranges change slowly; `stamp` says what the recording has.
    fn drive(stamp: impl Fn(u32) -> f64) -> Vec<Row> {
        (0..100)
            .map(|k| Row {
                line: k as usize + 2,
                t_s: stamp(k),
                ticks: [Some(i32::try_from(k).unwrap() * 100); 2],
                readings: vec![1.0 + 0.01 * f64::from(k); 4],
            })
            .collect()
    }

    fn right(k: u32) -> f64 {
        0.1 * f64::from(k)
    }

    fn repaired(mut rows: Vec<Row>) -> (Vec<f64>, Stamps) {
        let stamps = repair(&mut rows, WHEEL, None).unwrap();
        (rows.iter().map(|row| row.t_s).collect(), stamps)
    }

    fn assert_right(times: &[f64], within_s: f64) {
        assert_eq!(times.len(), 100);
        for (k, t_s) in (0u32..).zip(times) {
            assert!((t_s - times[0] - right(k)).abs() <= within_s, "row {k}: {t_s}");
        }
    }

    #[test]
    fn right_stamps_stay() {
        let (times, stamps) = repaired(drive(right));
        assert_right(&times, 0.0);
        assert!(stamps.remarks.is_empty() && stamps.unix_zero_us.is_none());
    }

    #[test]
    fn single_wrong_stamps_are_interpolated() {
        for wrong in [4_294_967.295, 0.0, -1.0, f64::NAN, 1.7e9, 4.0] {
            for at in [0..1, 50..51, 50..53, 99..100] {
                let is_wrong = |k: u32| at.contains(&(k as usize));
                let scatter = |k: u32| if at.len() > 1 { 1e5 * f64::from(k % 2) } else { 0.0 };
                let (times, stamps) = repaired(drive(|k| if is_wrong(k) { wrong + scatter(k) } else { right(k) }));
                // At the ends a stamp near the others may be right.
                if at.start == 50 || (at.start == 0 && wrong.abs() > 2.0) || wrong.is_nan() && at.start < 99 {
                    assert_right(&times, 0.11);
                    assert!(stamps.remarks[0].starts_with(&format!("line {}:", at.start + 2)), "{:?}", stamps.remarks);
                }
                assert!(times.windows(2).all(|pair| pair[0] <= pair[1]), "{wrong} at {at:?}: {times:?}");
            }
        }
    }

    #[test]
    fn steps_of_the_clock_follow_on() {
        for step_s in [-3600.0, -0.45, -5.0, 1.7e9] {
            let (times, stamps) = repaired(drive(|k| right(k) + if k >= 50 { step_s } else { 0.0 }));
            assert_right(&times, 0.11);
            assert!(stamps.remarks[0].starts_with("line 52: the clock steps by "), "{:?}", stamps.remarks);
            assert_eq!(stamps.unix_zero_us.is_some(), step_s > 1e9);
        }
    }

    #[test]
    fn many_steps_are_summed_up() {
        let (times, stamps) = repaired(drive(|k| right(99 - k)));
        assert!(times.windows(2).all(|pair| pair[0] <= pair[1]));
        assert_eq!(
            stamps.remarks,
            [
                "lines 3 to 101: the clock steps 99 times; the rows after each step follow on: are the rows in reverse order? Sort them by their time"
            ]
        );
        let (_, stamps) = repaired(drive(|k| right(k) - 3.0 * f64::from(k / 10)));
        assert_eq!(stamps.remarks, ["lines 12 to 92: the clock steps 9 times; the rows after each step follow on"]);
    }

    #[test]
    fn a_pause_stays() {
        let (times, stamps) = repaired(drive(|k| right(k) + if k >= 50 { 3600.0 } else { 0.0 }));
        assert!((times[50] - 3605.0).abs() < 1e-9 && (times[99] - 3609.9).abs() < 1e-9);
        assert_eq!(stamps.remarks, ["line 52: a pause of 3600 s"]);
    }

    #[test]
    fn a_calendars_time_is_the_begin() {
        let (times, stamps) = repaired(drive(|k| 1_700_000_000.25 + right(k)));
        assert_right(&times, 1e-6);
        assert_eq!(stamps.unix_zero_us, Some(1_700_000_000_250_000));
    }

    #[test]
    fn a_board_that_starts_anew_goes_on_and_another_run_does_not() {
        let anew = |elsewhere: bool| {
            let mut rows = drive(|k| right(k % 60));
            for (k, row) in rows.iter_mut().enumerate().skip(60) {
                row.ticks = [Some(i32::try_from(k - 60).unwrap() * 100); 2];
                if elsewhere {
                    row.readings = vec![0.4; 4];
                }
            }
            rows
        };
        let (times, stamps) = repaired(anew(false));
        assert_right(&times, 0.11);
        assert!(stamps.remarks[0].contains("line 62: the clock steps by"), "{:?}", stamps.remarks);
        for (run, count) in [(None, 60), (Some(1), 60), (Some(2), 40)] {
            let mut rows = anew(true);
            let stamps = repair(&mut rows, WHEEL, run).unwrap();
            assert_eq!(rows.len(), count);
            assert!(stamps.remarks[0].starts_with("line 62: another run begins here"), "{:?}", stamps.remarks);
        }
    }

    #[test]
    fn a_run_that_is_not_there_is_an_error_that_says_how_many_there_are() {
        let two = drive(|k| right(k % 60)).into_iter().enumerate().map(|(k, row)| Row {
            ticks: [Some(i32::try_from(k % 60).unwrap() * 100); 2],
            readings: vec![if k < 60 { 2.0 } else { 0.4 }; 4],
            ..row
        });
        let error = repair(&mut two.collect(), WHEEL, Some(3)).unwrap_err();
        assert_eq!(error, "--run 3: the recording has 2 runs; after the first they begin in line 62");
        let error = repair(&mut drive(right), WHEEL, Some(2)).unwrap_err();
        assert_eq!(error, "--run 2: the recording has 1 run");
    }
}
