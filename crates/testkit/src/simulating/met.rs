//! What runs have met.

use std::fmt;

#[derive(Clone, Copy, Debug, Default)]
pub struct Met {
    pub runs: u64,
    pub clean_runs: u64,
    pub true_us: u64,
    pub hang_ups: u64,
    pub resets: u64,
    pub silences: u64,
    pub stalls: u64,
    pub sleeps: u64,
    pub deaths: u64,
    pub slips: u64,
    pub overrun: u64,
    pub disk_modes: u64,
    pub disk_errors: u64,
    pub chunks: u64,
    pub chunks_lost: u64,
    pub accepted: u64,
    pub rejected: u64,
    pub sweeps: u64,
    pub wakes: u64,
    pub restarts_told: u64,
    /// Sweeps whose drive was nowhere disturbed, and their greatest position error, millimetres.
    pub worst_clean_mm: u64,
    /// Undisturbed drives with a pose that was half a metre off or more.
    pub clean_and_off: u64,
    pub worst_mm: u64,
}

impl Met {
    pub fn add(&mut self, other: &Self) {
        let sums = [
            (&mut self.runs, other.runs),
            (&mut self.clean_runs, other.clean_runs),
            (&mut self.true_us, other.true_us),
            (&mut self.hang_ups, other.hang_ups),
            (&mut self.resets, other.resets),
            (&mut self.silences, other.silences),
            (&mut self.stalls, other.stalls),
            (&mut self.sleeps, other.sleeps),
            (&mut self.deaths, other.deaths),
            (&mut self.slips, other.slips),
            (&mut self.overrun, other.overrun),
            (&mut self.disk_modes, other.disk_modes),
            (&mut self.disk_errors, other.disk_errors),
            (&mut self.chunks, other.chunks),
            (&mut self.chunks_lost, other.chunks_lost),
            (&mut self.accepted, other.accepted),
            (&mut self.rejected, other.rejected),
            (&mut self.sweeps, other.sweeps),
            (&mut self.wakes, other.wakes),
            (&mut self.restarts_told, other.restarts_told),
        ];
        for (sum, more) in sums {
            *sum += more;
        }
        self.clean_and_off += other.clean_and_off;
        self.worst_clean_mm = self.worst_clean_mm.max(other.worst_clean_mm);
        self.worst_mm = self.worst_mm.max(other.worst_mm);
    }

    pub fn seconds(&self) -> f64 {
        self.true_us as f64 * 1e-6
    }
}

/// A table.
impl fmt::Display for Met {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = [
            ("runs, and of them undisturbed but for the disk", format!("{}, {}", self.runs, self.clean_runs)),
            ("seconds of robot time", format!("{:.0}", self.seconds())),
            ("hang-ups", self.hang_ups.to_string()),
            ("board resets; restarts reported", format!("{}, {}", self.resets, self.restarts_told)),
            ("silences of the line", self.silences.to_string()),
            ("stalls of the program", self.stalls.to_string()),
            ("sleeps of the machine", self.sleeps.to_string()),
            ("deaths of the program", self.deaths.to_string()),
            ("bytes damaged, lost or added", self.slips.to_string()),
            ("bytes that found no room", self.overrun.to_string()),
            ("changes of the injected disk error", self.disk_modes.to_string()),
            ("disk errors reported", self.disk_errors.to_string()),
            ("chunks to be recorded, and of them lost to the disk", format!("{}, {}", self.chunks, self.chunks_lost)),
            ("frames accepted, rejected", format!("{}, {}", self.accepted, self.rejected)),
            ("sweeps", self.sweeps.to_string()),
            ("wakes of the loop", self.wakes.to_string()),
            ("greatest position error, undisturbed, m", format!("{:.3}", self.worst_clean_mm as f64 * 1e-3)),
            ("undisturbed runs that were ever farther off than 0.5 m", self.clean_and_off.to_string()),
            ("greatest position error, all but killed and restarted, m", format!("{:.3}", self.worst_mm as f64 * 1e-3)),
        ];
        writeln!(f, "| met | |\n|---|---|")?;
        rows.iter().try_for_each(|(what, count)| writeln!(f, "| {what} | {count} |"))
    }
}
