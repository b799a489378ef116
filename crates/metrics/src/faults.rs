//! The schedule of true faults, with which the detector's results are compared.

use slamd_core::{FaultKind, Timestamp};
use std::str::FromStr;
use std::time::Duration;

/// A true sensor fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueFault {
    /// The sensor's id.
    pub sensor: usize,
    /// The kind of fault.
    pub kind: FaultKind,
    /// Start of the fault.
    pub from: Timestamp,
    /// End of the fault; `None`: permanent.
    pub until: Option<Timestamp>,
}

impl TrueFault {
    pub(super) fn is_on(&self, at: Timestamp) -> bool {
        self.from <= at && self.until.is_none_or(|until| at < until)
    }
}

/// A text that is not `SENSOR:KIND@TIME[-TIME]`.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("`{0}` is not SENSOR:KIND@TIME with a KIND of saturated, missing, noisy or stuck, such as 7:saturated@30s")]
pub struct TrueFaultError(String);

impl FromStr for TrueFault {
    type Err = TrueFaultError;

    fn from_str(text: &str) -> Result<Self, TrueFaultError> {
        parse(text).ok_or_else(|| TrueFaultError(text.into()))
    }
}

fn parse(text: &str) -> Option<TrueFault> {
    let (sensor, rest) = text.split_once(':')?;
    let (word, span) = rest.split_once('@')?;
    let kind = word.parse().ok()?;
    let time = |text: &str| {
        let time_s: f64 = text.strip_suffix('s').unwrap_or(text).parse().ok()?;
        Some(Timestamp::default() + Duration::try_from_secs_f64(time_s).ok()?)
    };
    let (from, until) = match span.split_once('-') {
        Some((from, until)) => (time(from)?, Some(time(until)?)),
        None => (time(span)?, None),
    };
    Some(TrueFault { sensor: sensor.parse().ok()?, kind, from, until })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: u64) -> Timestamp {
        Timestamp::from_us(seconds * 1_000_000)
    }

    #[test]
    fn schedules_are_parsed() {
        let fault = TrueFault { sensor: 7, kind: FaultKind::Saturated, from: s(30), until: None };
        assert_eq!("7:saturated@30s".parse(), Ok(fault));
        assert_eq!("7:saturated@30".parse(), Ok(fault));
        assert_eq!("7:saturated@30s-40s".parse(), Ok(TrueFault { until: Some(s(40)), ..fault }));
        for text in ["", "7", "7:saturated", "7:broken@3s", "x:noisy@3s", "7:noisy@-3s", "7:noisy@nan", "7:noisy@3-"] {
            assert!(text.parse::<TrueFault>().is_err(), "{text}");
        }
    }
}
