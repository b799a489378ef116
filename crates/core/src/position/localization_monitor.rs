//! Does the map still agree with what the sensors measure?
//!
//! A healthy beam whose cone squarely holds a well-known wall must measure it, or another well-known wall before it. A reading that
//! is neither contradicts the map; a reading that a well-known wall explains confirms it. Open doors and furniture before known
//! walls contradict, too, but few beams at a time. While many readings contradict, map updates are suspended so that the map is not
//! duplicated. When about as many contradict as confirm, the robot is lost.
//!
//! Two exponential averages of the confirming readings c and the contradicting ones x, with n neutral ones added: `x / (c + x + n)`.

use super::params::MonitorParams;

/// Counts readings that confirm and contradict the map, over a short and a long time.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalizationMonitor {
    short_term: Evidence,
    long_term: Evidence,
    params: MonitorParams,
}

/// Exponentially forgotten counts.
#[derive(Clone, Copy, Debug, Default)]
struct Evidence {
    confirmed: f64,
    contradicted: f64,
}

impl LocalizationMonitor {
    /// No reading yet.
    #[must_use]
    pub fn new(params: MonitorParams) -> Self {
        Self { params, ..Self::default() }
    }

    /// Adds a reading: whether a well-known wall explains it, and the range at which a wall must be measured. True if it contradicts.
    pub fn add(&mut self, is_explained: bool, expected_m: Option<f64>, range_m: f64) -> bool {
        let is_off = |expected_m: f64| (range_m - expected_m).abs() > self.params.max_error_m;
        let contradicts = !is_explained && expected_m.is_some_and(is_off);
        if is_explained || contradicts {
            self.short_term.add(contradicts, self.params.short_readings);
            self.long_term.add(contradicts, self.params.long_readings);
        }
        contradicts
    }

    /// Forgets all readings.
    pub fn reset(&mut self) {
        *self = Self::new(self.params);
    }

    /// True while the last readings agree with the map.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.short_term.contradiction(self.params.short_neutral) <= self.params.max_sure
    }

    /// True while so many readings contradict that map updates are suspended.
    #[must_use]
    pub fn is_doubtful(&self) -> bool {
        self.short_term.contradiction(self.params.short_neutral) > self.params.max_learning
    }

    /// True once so many readings have contradicted that the robot is elsewhere.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.long_term.contradiction(self.params.long_neutral) > self.params.max_kept
    }
}

impl Evidence {
    fn add(&mut self, contradicts: bool, readings: f64) {
        let keep = 1.0 - 1.0 / readings;
        self.confirmed = keep * self.confirmed + f64::from(u8::from(!contradicts));
        self.contradicted = keep * self.contradicted + f64::from(u8::from(contradicts));
    }

    fn contradiction(&self, neutral: f64) -> f64 {
        self.contradicted / (self.confirmed + self.contradicted + neutral)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A monitor after 300 readings, of which one in `every` contradicts the map.
    fn after(every: u32) -> LocalizationMonitor {
        let mut monitor = LocalizationMonitor::new(MonitorParams::default());
        for reading in 1..=300 {
            let contradicts = reading % every == 0;
            monitor.add(!contradicts, Some(1.0), if contradicts { 2.0 } else { 1.0 });
        }
        monitor
    }

    #[test]
    fn an_open_door_keeps_the_robot_localized_and_another_room_loses_it() {
        let door = after(15);
        assert!(door.is_sure() && !door.is_doubtful() && !door.is_lost(), "{door:?}");
        let room = after(1);
        assert!(!room.is_sure() && room.is_doubtful() && room.is_lost(), "{room:?}");
    }

    #[test]
    fn updates_stop_before_the_robot_is_lost() {
        let third = after(3);
        assert!(third.is_doubtful() && !third.is_lost(), "{third:?}");
    }

    #[test]
    fn a_reading_without_a_prediction_says_nothing() {
        let mut monitor = after(15);
        let before = format!("{monitor:?}");
        monitor.add(false, None, 2.0);
        monitor.add(false, Some(1.9), 2.0);
        assert_eq!(format!("{monitor:?}"), before);
        monitor.reset();
        assert_eq!(format!("{monitor:?}"), format!("{:?}", LocalizationMonitor::new(MonitorParams::default())));
    }
}
