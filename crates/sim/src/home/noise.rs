//! What a home does to readings: ghosts, crosstalk and echoes that are too weak.

use super::Home;
use super::echo::Echo;
use crate::random::Random;
use crate::sonar::{MAX_RANGE_M, MIN_RANGE_M};

/// Probability that a ping at a soft or thin surface hears nothing.
const WEAK_MISS: f64 = 0.25;
/// Probability that any other ping hears nothing.
const MISS: f64 = 0.005;

/// Disturbs what the sensors of one group hear.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    random: Random,
}

impl Noise {
    pub(crate) const fn new(random: Random) -> Self {
        Self { random }
    }

    /// The distance that the sensor with `index` reads, given what each sensor of its group hears, metres.
    /// Every call draws the same number of random numbers.
    pub(crate) fn distance_m(&mut self, home: &Home, group: &[Option<Echo>], index: usize) -> Option<f64> {
        let [miss, ghost, crosstalk, share] = [(); 4].map(|()| self.random.uniform(0.0, 1.0));
        let other = self.random.below(group.len());
        let own = group.get(index).copied().flatten();
        let own = own.filter(|echo| miss >= if echo.is_weak { WEAK_MISS } else { MISS }).map(|echo| echo.distance_m);
        if ghost < home.ghosts {
            // A ghost is nearer than the true echo: the sensor reports the first sound.
            return Some(MIN_RANGE_M + share * (own.unwrap_or(MAX_RANGE_M) - MIN_RANGE_M));
        }
        let heard = group.get(other).copied().flatten().map(|echo| echo.distance_m);
        match (own, heard) {
            (Some(own_m), Some(heard_m)) if crosstalk < home.crosstalk => Some(own_m.min(heard_m)),
            (None, heard) if crosstalk < home.crosstalk => heard,
            (own, _) => own,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn read(home: &Home, group: &[Option<Echo>]) -> Vec<Option<f64>> {
        let mut noise = Noise::new(Random::new(1, Stream::Acoustics));
        (0..2000).map(|_| noise.distance_m(home, group, 0)).collect()
    }

    #[test]
    fn each_disturbance_has_its_rate() {
        let echo = |distance_m, is_weak| Some(Echo { distance_m, is_weak });
        let misses = |is_weak| {
            let read = read(&Home::default(), &[echo(2.0, is_weak)]);
            read.iter().filter(|m| m.is_none()).count()
        };
        assert!((400..600).contains(&misses(true)) && (2..25).contains(&misses(false)));
        let shorter =
            |home: &Home, group: &[Option<Echo>]| read(home, group).iter().flatten().filter(|m| **m < 1.99).count();
        let ghosts = Home { ghosts: 0.1, ..Home::default() };
        assert!((150..250).contains(&shorter(&ghosts, &[echo(2.0, false)])));
        let crosstalk = Home { crosstalk: 0.2, ..Home::default() };
        // Half of the drawn sensors are the other one.
        assert!((150..250).contains(&shorter(&crosstalk, &[echo(2.0, false), echo(1.0, false)])));
        assert_eq!(shorter(&Home::default(), &[echo(2.0, false), echo(1.0, false)]), 0);
    }
}
