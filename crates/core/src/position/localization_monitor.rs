//! Does the robot still know where it is?
//!
//! Where a well-known wall is squarely in a healthy beam's cone, the beam must hear it, or another well-known wall before it. A reading
//! that is neither contradicts the map; one that a well-known wall explains confirms it. Doors in known walls and furniture before
//! them contradict, too, but few beams at a time. While much contradicts, nothing is learnt, lest a second map grow over the first; when
//! about as much contradicts as confirms, the lock is lost.

/// Weighs what is heard against what the walls promise: a short memory for doubt, a long one for certainty.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalizationMonitor {
    lately: Balance,
    lastingly: Balance,
}

/// Readings for and against.
#[derive(Clone, Copy, Debug, Default)]
struct Balance {
    confirmed: f64,
    contradicted: f64,
}

/// A reading this far off the expected one contradicts, metres.
const OFF_M: f64 = 0.15;
/// Readings that each memory holds, and as if so many more had been heard that say nothing.
const SHORT: f64 = 25.0;
const SHORT_NEUTRAL: f64 = 3.0;
const LONG: f64 = 90.0;
const LONG_NEUTRAL: f64 = 6.0;
/// Shares of contradicting readings: up to this the place is sure, from this on it is doubted, from this on lost.
const SURE: f64 = 0.12;
const DOUBT: f64 = 0.25;
const LOST: f64 = 0.45;

impl LocalizationMonitor {
    /// Weighs one reading: whether a well-known wall explains it, and where a wall must be heard.
    pub fn weigh(&mut self, is_explained: bool, expected_m: Option<f64>, range_m: f64) {
        let contradicts = !is_explained && expected_m.is_some_and(|expected_m| (range_m - expected_m).abs() > OFF_M);
        if is_explained || contradicts {
            self.lately.add(contradicts, SHORT);
            self.lastingly.add(contradicts, LONG);
        }
    }

    /// True while what was lately heard agrees with the walls.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.lately.contradiction(SHORT_NEUTRAL) <= SURE
    }

    /// True while so much contradicts that nothing should be learnt.
    #[must_use]
    pub fn is_doubtful(&self) -> bool {
        self.lately.contradiction(SHORT_NEUTRAL) > DOUBT
    }

    /// True once so much has contradicted that the robot is elsewhere.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.lastingly.contradiction(LONG_NEUTRAL) > LOST
    }
}

impl Balance {
    fn add(&mut self, contradicts: bool, memory: f64) {
        let keep = 1.0 - 1.0 / memory;
        self.confirmed = keep * self.confirmed + f64::from(u8::from(!contradicts));
        self.contradicted = keep * self.contradicted + f64::from(u8::from(contradicts));
    }

    fn contradiction(&self, neutral: f64) -> f64 {
        self.contradicted / (self.confirmed + self.contradicted + neutral)
    }
}
