//! Faults of wheel encoders: which wheel, which kind and when. Only the reported counts change,
//! not the robot's motion.

use std::str::FromStr;

/// The wheel whose encoder is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wheel {
    /// The left wheel.
    Left,
    /// The right wheel.
    Right,
}

/// The kind of an encoder fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderFaultKind {
    /// The count does not change.
    Dead,
    /// The count runs backwards.
    Reversed,
}

/// One fault of one encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderFault {
    /// The wheel whose encoder is faulty.
    pub wheel: Wheel,
    /// The kind of fault.
    pub kind: EncoderFaultKind,
    /// Start of the fault, seconds from the session's start.
    pub from_s: f64,
    /// End of the fault, seconds from the session's start. Infinite: the fault is permanent.
    pub until_s: f64,
}

impl FromStr for EncoderFault {
    type Err = String;

    /// Parses `left:dead`, `right:reversed@30s` or `right:reversed@30s-40s`. The `s` is optional.
    fn from_str(text: &str) -> Result<Self, String> {
        let malformed = || format!("encoder fault \"{text}\" is not WHEEL:KIND@TIME, for example left:dead@30s");
        let (wheel, rest) = text.split_once(':').ok_or_else(malformed)?;
        let (kind, span) = rest.split_once('@').unwrap_or((rest, "0"));
        let (from, until) = span.split_once('-').map_or((span, None), |(from, until)| (from, Some(until)));
        let seconds = |time: &str| {
            let parsed = time.strip_suffix('s').unwrap_or(time).parse().ok();
            parsed.filter(|s: &f64| s.is_finite() && *s >= 0.0).ok_or_else(|| {
                format!("encoder fault \"{text}\": \"{time}\" is not a time in seconds, for example 30s")
            })
        };
        let wheel = match wheel {
            "left" => Wheel::Left,
            "right" => Wheel::Right,
            _ => return Err(format!("encoder fault \"{text}\": \"{wheel}\" is neither left nor right")),
        };
        let kind = match kind {
            "dead" => EncoderFaultKind::Dead,
            "reversed" => EncoderFaultKind::Reversed,
            _ => return Err(format!("encoder fault \"{text}\": \"{kind}\" is neither dead nor reversed")),
        };
        Ok(Self { wheel, kind, from_s: seconds(from)?, until_s: until.map_or(Ok(f64::INFINITY), seconds)? })
    }
}

/// Writes the form that [`EncoderFault::from_str`] parses.
impl std::fmt::Display for EncoderFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let wheel = match self.wheel {
            Wheel::Left => "left",
            Wheel::Right => "right",
        };
        let kind = match self.kind {
            EncoderFaultKind::Dead => "dead",
            EncoderFaultKind::Reversed => "reversed",
        };
        write!(f, "{wheel}:{kind}@{}s", self.from_s)?;
        if self.until_s.is_finite() { write!(f, "-{}s", self.until_s) } else { Ok(()) }
    }
}

/// Turns true counts into those of the faulty encoders.
#[derive(Clone, Debug, Default)]
pub(super) struct Encoders {
    schedule: Vec<EncoderFault>,
    true_ticks: [i32; 2],
    reported_ticks: [i32; 2],
}

impl Encoders {
    pub(super) fn new(schedule: Vec<EncoderFault>) -> Self {
        Self { schedule, ..Self::default() }
    }

    /// The reported counts, left and right, at `at_s` seconds. `ticks` are the true counts.
    pub(super) fn counts(&mut self, at_s: f64, ticks: [i32; 2]) -> [i32; 2] {
        for (index, wheel) in [Wheel::Left, Wheel::Right].into_iter().enumerate() {
            let step = ticks[index].wrapping_sub(self.true_ticks[index]);
            let is_on = |f: &&EncoderFault| f.wheel == wheel && f.from_s <= at_s && at_s < f.until_s;
            let reported = match self.schedule.iter().find(is_on).map(|fault| fault.kind) {
                None => step,
                Some(EncoderFaultKind::Dead) => 0,
                Some(EncoderFaultKind::Reversed) => step.wrapping_neg(),
            };
            self.reported_ticks[index] = self.reported_ticks[index].wrapping_add(reported);
        }
        self.true_ticks = ticks;
        self.reported_ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_encoder_stops_and_a_reversed_one_counts_backwards() {
        let mut encoders = Encoders::new(vec!["left:dead@2-4".parse().unwrap(), "right:reversed@3s".parse().unwrap()]);
        let reported: Vec<_> =
            (1..=5).map(|second| encoders.counts(f64::from(second), [10 * second, 20 * second])).collect();
        assert_eq!(reported, [[10, 20], [10, 40], [10, 20], [20, 0], [30, -20]]);
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let error = |text: &str| text.parse::<EncoderFault>().unwrap_err();
        assert!(error("left").contains("is not WHEEL:KIND@TIME"));
        assert!(error("middle:dead").contains("\"middle\" is neither left nor right"));
        assert!(error("left:odd").contains("\"odd\" is neither dead nor reversed"));
        assert!(error("left:dead@soon").contains("\"soon\" is not a time"));
    }
}
