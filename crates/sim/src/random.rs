//! Random numbers from one seed, one stream per subsystem. So another fault does not change the
//! drive.
//!
//! The distributions here use only the generator's specified 64-bit output and `libm`. So a seed
//! gives the same numbers on every machine and with every later version of any library.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng as _;
use std::f64::consts::TAU;

/// The subsystems that draw random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The robot's start heading.
    Start = 1,
    /// Wheel sizes, base and slip.
    Robot,
    /// The robot's next goals.
    Explore,
    /// Noise of healthy sensors.
    Sonar,
    /// Which sensors are faulty, and their readings.
    Fault,
    /// The board's clock and identity.
    Board,
    /// Jitter and faults of the serial line.
    Link,
    /// The sensors' calibration errors.
    Mounting,
    /// A random home.
    Home,
    /// What moves in it.
    Life,
    /// Ghosts, crosstalk and weak echoes in it.
    Acoustics,
    /// Faults of the robot, and hands that move it.
    RobotFault,
}

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub struct Random {
    generator: Pcg64,
}

impl Random {
    /// The generator of `stream` for `seed`.
    #[must_use]
    pub fn new(seed: u64, stream: Stream) -> Self {
        // PCG streams with the same state are correlated, so each stream gets a state of its own.
        let stream = stream as u64;
        let low = mix(seed ^ mix(stream));
        let high = mix(low);
        Self { generator: Pcg64::new(u128::from(high) << 64 | u128::from(low), u128::from(stream)) }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// Uniform in `[from, to)`.
    pub fn uniform(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * ((self.bits() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Normal with mean 0 and standard deviation 1 (Box-Muller; uses one of the pair).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform(0.0, 1.0))).sqrt();
        radius * libm::cos(self.uniform(0.0, TAU))
    }

    /// −1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.bits() >> 63 == 0 { -1.0 } else { 1.0 }
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    /// A whole number below `bound`, which is at least 1.
    #[expect(clippy::cast_possible_truncation, reason = "the high half of a product with a usize fits one")]
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.bits()) * bound.max(1) as u128) >> 64) as usize
    }
}

/// The output function of SplitMix64.
const fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_0_and_deviation_1() {
        let mut random = Random::new(3, Stream::Sonar);
        let drawn: Vec<f64> = (0..20_000).map(|_| random.normal()).collect();
        let mean = drawn.iter().sum::<f64>() / drawn.len() as f64;
        let variance = drawn.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / drawn.len() as f64;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
    }

    #[test]
    fn streams_and_seeds_differ() {
        let first = |seed, stream| Random::new(seed, stream).bits();
        assert_ne!(first(1, Stream::Sonar), first(1, Stream::Fault));
        assert_ne!(first(1, Stream::Sonar), first(2, Stream::Sonar));
        assert_eq!(first(1, Stream::Sonar), first(1, Stream::Sonar));
    }

    #[test]
    fn whole_numbers_stay_below_their_bound_and_reach_all_values() {
        let mut random = Random::new(1, Stream::Explore);
        let mut seen = [false; 5];
        (0..200).for_each(|_| seen[random.below(5)] = true);
        assert_eq!(seen, [true; 5]);
    }
}
