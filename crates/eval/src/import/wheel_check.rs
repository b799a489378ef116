//! The counts of a recording as the estimator will judge them, with the lines where they are wrong.

use slamd_core::config::RobotConfig;
use slamd_core::stages::{AlignParams, WheelSteps};
use slamd_core::{DeviceTime, Timestamp};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Judges the counts of one recording.
pub(super) struct WheelCheck {
    steps: WheelSteps,
    metres_per_tick: [f64; 2],
    /// The last rows: what is wrong is known some rows later.
    lines: VecDeque<(DeviceTime, usize)>,
    remarks: Vec<String>,
}

const KEPT_LINES: usize = 32;

impl WheelCheck {
    pub(super) fn new(robot: &RobotConfig) -> Self {
        let ticks_per_turn = f64::from(robot.ticks_per_turn.unwrap_or(u32::MAX));
        Self {
            steps: WheelSteps::new(robot.max_speed_m_s, AlignParams::default()),
            metres_per_tick: [TAU * robot.wheel_radius_m / ticks_per_turn; 2],
            lines: VecDeque::with_capacity(KEPT_LINES),
            remarks: Vec::new(),
        }
    }

    /// Takes the counts of a line at its time in the capture.
    pub(super) fn row(&mut self, line: usize, at: Timestamp, ticks: [i32; 2]) {
        let at = DeviceTime::from_us(at.us());
        self.lines.truncate(KEPT_LINES - 1);
        self.lines.push_front((at, line));
        self.steps.add(at, ticks, self.metres_per_tick);
        while let Some(trouble) = self.steps.take_trouble() {
            let line = self.lines.iter().find(|(then, _)| *then == trouble.at).map_or(line, |(_, line)| *line);
            self.remarks.push(format!("line {line}: {trouble}: {}", trouble.remedy()));
        }
    }

    /// What is wrong, each with its line.
    pub(super) fn into_remarks(self) -> Vec<String> {
        self.remarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_that_start_anew_are_named_with_their_line() {
        let robot = RobotConfig { ticks_per_turn: Some(1_440), ..RobotConfig::default() };
        let mut check = WheelCheck::new(&robot);
        for row in 0..900_u16 {
            let ticks = i32::from(if row < 450 { row } else { row - 450 }) * 150;
            check.row(usize::from(row) + 2, Timestamp::from_us(u64::from(row) * 100_000), [ticks; 2]);
        }
        let remarks = check.into_remarks();
        let [remark] = remarks.as_slice() else { panic!("{remarks:?}") };
        assert!(remark.starts_with("line 452: the left wheel would have rolled -"), "{remark}");
        assert!(remark.contains("in 0.1 s; the counters start anew"), "{remark}");
    }
}
