//! What a sensor's neighbours say it must hear.
//!
//! Where the nearest trusted sensors on both sides hear a surface at about the same distance, the one between them looks at it, too. That
//! needs neither map nor pose, so it works from the first sweep on and with a robot that is lost. A door between two jambs
//! looks like a fault for a moment; the sequential test tolerates that.

use super::params::Params;
use crate::geometry::{Ring, wrap_angle};
use crate::sweep::Sweep;

/// Which sensors look beside which.
#[derive(Clone, Debug)]
pub(crate) struct Neighbours {
    /// By sensor: left and right, the nearer ones first.
    beside: Vec<[[Option<usize>; DEPTH]; 2]>,
    bearings_rad: Vec<f64>,
    agree_m: f64,
}

/// What the neighbours see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// The farther one of the two that look on either side, metres.
    pub range_m: f64,
    /// How many neighbours see it.
    pub witnesses: usize,
    /// The angle between those two, radians: the wider, the more may hide between them.
    pub span_rad: f64,
}

/// Neighbours kept on each side: where the nearest is broken, the next one is used.
const DEPTH: usize = 3;

impl Neighbours {
    /// The neighbours in a ring.
    #[must_use]
    pub(crate) fn new(ring: &Ring, params: &Params) -> Self {
        let bearings_rad: Vec<f64> =
            ring.mountings.iter().map(|mounting| mounting.robot_from_sensor.theta_rad).collect();
        let side = |sensor: usize, sign: f64| {
            let aside = |other: usize| sign * wrap_angle(bearings_rad[other] - bearings_rad[sensor]);
            let mut others: Vec<usize> = (0..ring.len())
                .filter(|&other| aside(other) > 1e-6 && aside(other) <= params.neighbour_aside_rad)
                .collect();
            others.sort_by(|&a, &b| aside(a).total_cmp(&aside(b)));
            std::array::from_fn(|index| others.get(index).copied())
        };
        let beside = (0..ring.len()).map(|sensor| [side(sensor, 1.0), side(sensor, -1.0)]).collect();
        Self { beside, bearings_rad, agree_m: params.neighbour_agree_m }
    }

    /// The surface that trusted neighbours on both sides see; none where one side has no such neighbour, it hears nothing, or the
    /// two disagree.
    pub(crate) fn seen(&self, sensor: usize, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool) -> Option<Seen> {
        let beside = self.beside.get(sensor)?;
        let range_m = |other: usize| sweep.beams.get(other).map_or(f64::NAN, |beam| beam.range_m);
        let nearest = |side: &[Option<usize>; DEPTH]| {
            let trusted = side.iter().flatten().copied().find(|&other| is_trusted(other));
            trusted.filter(|&other| range_m(other).is_finite())
        };
        let (left, right) = (nearest(&beside[0])?, nearest(&beside[1])?);
        let (left_m, right_m) = (range_m(left), range_m(right));
        if (left_m - right_m).abs() > self.agree_m {
            return None;
        }
        let farthest_m = left_m.max(right_m);
        let others = beside.iter().flatten().flatten().filter(|&&other| is_trusted(other));
        let witnesses = others.filter(|&&other| (range_m(other) - farthest_m).abs() <= self.agree_m).count();
        let span_rad = wrap_angle(self.bearings_rad[left] - self.bearings_rad[right]).abs();
        Some(Seen { range_m: farthest_m, witnesses, span_rad })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ring;
    use crate::sweep::Beam;

    fn sweep(ring: &Ring, range_m: impl Fn(usize) -> f64) -> Sweep {
        let beam = |(sensor, mounting): (usize, &crate::geometry::Mounting)| Beam {
            range_m: range_m(sensor),
            no_measurement: None,
            age_s: 0.0,
            robot_from_sensor: mounting.robot_from_sensor,
            half_angle_rad: mounting.half_angle_rad,
        };
        Sweep { beams: ring.mountings.iter().enumerate().map(beam).collect(), ..Sweep::default() }
    }

    #[test]
    fn both_sides_must_see_it() {
        let ring = Ring::circle(32, 0.15, 0.2, 4);
        let neighbours = Neighbours::new(&ring, &Params::default());
        let wall = |sensor: usize| if sensor == 7 || sensor > 9 { f64::INFINITY } else { 1.2 };
        let seen = neighbours.seen(7, &sweep(&ring, wall), |_| true).unwrap();
        assert_eq!((seen.range_m, seen.witnesses), (1.2, 5));
        assert!((seen.span_rad.to_degrees() - 22.5).abs() < 1e-9, "{seen:?}");
        assert_eq!(neighbours.seen(9, &sweep(&ring, wall), |_| true), None, "nothing on its left");
        assert_eq!(neighbours.seen(5, &sweep(&ring, |s| s as f64), |_| true), None, "they disagree");
    }

    #[test]
    fn a_distrusted_neighbour_gives_way_to_the_next() {
        let ring = Ring::circle(32, 0.15, 0.2, 4);
        let neighbours = Neighbours::new(&ring, &Params::default());
        let sweep = sweep(&ring, |sensor| if sensor == 0 { 2.6 } else { 1.2 });
        assert_eq!(neighbours.seen(31, &sweep, |_| true), None);
        assert!(neighbours.seen(31, &sweep, |sensor| sensor != 0).unwrap().range_m < 1.3);
    }

    #[test]
    fn sensors_far_apart_say_nothing_of_each_other() {
        let ring = Ring::circle(7, 0.15, 0.2, 4);
        assert_eq!(Neighbours::new(&ring, &Params::default()).seen(3, &sweep(&ring, |_| 1.0), |_| true), None);
    }
}
