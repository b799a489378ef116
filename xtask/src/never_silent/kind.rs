//! The kinds of drives, and what slamd should say about each.

use slamd_core::ModelAspect;
use slamd_sim::random::{Random, Stream};
use slamd_sim::robot_fault::RobotFault;

/// What differs in a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub(crate) enum Kind {
    /// The robot is as configured.
    Nominal,
    /// True over configured wheel radius: 0.5 to 2.
    WheelRadius,
    /// True over configured ticks per turn: a quarter to four.
    Ticks,
    /// Skid steering: the base is 1.3 to 2 times the configured one.
    Base,
    /// Left and right encoder are swapped.
    WheelsSwapped,
    /// Both encoders count backwards.
    WheelsReversed,
    /// The ring is numbered clockwise.
    RingMirrored,
    /// The ring is turned by 10 to 90 degrees.
    RingRotated,
    /// The ranges are half or twice the true ones.
    RangeUnit,
    /// The ranges scatter by 6 to 15 cm.
    RangeNoise,
    /// Radius and base are both off by 0.5 to 2: a robot without robot.toml.
    Scale,
    /// Carried elsewhere.
    Kidnap,
    /// Carried elsewhere, with nonsense from the sensors meanwhile.
    KidnapLifted,
    /// Pushed sideways by 0.1 to 0.5 m.
    Push,
    /// Wheels turn in place for a second.
    Spin,
}

/// When the robot is carried, pushed or spins, seconds.
pub(super) const LATE_S: f64 = 60.0;

impl Kind {
    pub(super) const ALL: [Self; 15] = [
        Self::Nominal,
        Self::WheelRadius,
        Self::Ticks,
        Self::Base,
        Self::WheelsSwapped,
        Self::WheelsReversed,
        Self::RingMirrored,
        Self::RingRotated,
        Self::RangeUnit,
        Self::RangeNoise,
        Self::Scale,
        Self::Kidnap,
        Self::KidnapLifted,
        Self::Push,
        Self::Spin,
    ];

    /// The word used on the command line.
    pub(super) fn word(self) -> String {
        clap::ValueEnum::to_possible_value(&self).map_or_else(String::new, |value| value.get_name().into())
    }

    /// The robot's faults in the drive of a seed, as on the command line of `slamd simulate`.
    pub(super) fn texts(self, seed: u64) -> Vec<String> {
        let mut random = Random::new(seed, Stream::Fault);
        // At least a tenth off, evenly on a logarithmic scale.
        let mut factor = || {
            let share = random.uniform(0.1, 1.0) * random.sign();
            format!("{:.3}", libm::exp2(share))
        };
        match self {
            Self::Nominal => Vec::new(),
            Self::WheelRadius => vec![format!("wheel-radius={}", factor())],
            Self::Scale => vec![format!("wheel-radius={}", factor()), format!("base={}", factor())],
            Self::Ticks => vec![format!("ticks={}", ["0.25", "0.5", "2", "4"][random.below(4)])],
            Self::Base => vec![format!("base={:.2}", random.uniform(1.3, 2.0))],
            Self::WheelsSwapped => vec!["wheels-swapped".into()],
            Self::WheelsReversed => vec!["wheels-reversed".into()],
            Self::RingMirrored => vec!["ring-mirrored".into()],
            Self::RingRotated => vec![format!("ring-rotated={:.0}", random.uniform(10.0, 90.0) * random.sign())],
            Self::RangeUnit => vec![format!("range-unit={}", ["0.5", "2"][random.below(2)])],
            Self::RangeNoise => vec![format!("range-noise={:.3}", random.uniform(0.06, 0.15))],
            Self::Kidnap => vec![format!("kidnap@{LATE_S}s")],
            Self::KidnapLifted => vec![format!("kidnap=lifted@{LATE_S}s")],
            Self::Push => vec![format!("push={:.2}@{LATE_S}s", random.uniform(0.1, 0.5))],
            Self::Spin => {
                let wheels = ["left", "right", "both"][random.below(3)];
                vec![format!("spin={wheels}@{LATE_S}s-{}s", LATE_S + 1.0)]
            }
        }
    }

    /// The same, parsed.
    pub(super) fn faults(self, seed: u64) -> Vec<RobotFault> {
        self.texts(seed).iter().map(|text| text.parse().expect("a valid fault")).collect()
    }

    /// The findings that name the cause; empty where there is nothing to find about the robot.
    pub(super) const fn causes(self) -> &'static [ModelAspect] {
        match self {
            Self::WheelRadius | Self::Ticks => &[ModelAspect::WheelScale],
            Self::Scale => &[ModelAspect::WheelScale, ModelAspect::TurnScale],
            Self::Base => &[ModelAspect::TurnScale],
            Self::WheelsSwapped | Self::RingMirrored => &[ModelAspect::TurnSign],
            Self::WheelsReversed => &[ModelAspect::WheelSigns],
            Self::RingRotated => &[ModelAspect::RingRotation],
            Self::RangeUnit => &[ModelAspect::RangeScale],
            Self::RangeNoise => &[ModelAspect::RangeNoise],
            Self::Nominal | Self::Kidnap | Self::KidnapLifted | Self::Push | Self::Spin => &[],
        }
    }

    /// True if hands move the robot.
    pub(super) const fn is_moved(self) -> bool {
        matches!(self, Self::Kidnap | Self::KidnapLifted | Self::Push)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_valid_faults_that_the_seed_determines() {
        for kind in Kind::ALL {
            for seed in 1..=20 {
                let faults = kind.faults(seed);
                assert_eq!(faults, kind.faults(seed));
                assert_eq!(faults.is_empty(), kind == Kind::Nominal);
            }
            assert!(!kind.word().is_empty());
        }
    }

    #[test]
    fn factors_are_at_least_a_tenth_off() {
        for seed in 1..=100 {
            let [RobotFault::WheelRadius(factor)] = Kind::WheelRadius.faults(seed)[..] else { panic!("one fault") };
            assert!((0.5..=0.94).contains(&factor) || (1.07..=2.0).contains(&factor), "{factor}");
        }
    }
}
