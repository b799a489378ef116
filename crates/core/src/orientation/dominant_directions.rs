//! The axis of an orthogonal building by a Hough transform over sonar arcs.
//!
//! A sonar return is not a point but the nearest surface within a cone. For a wall whose normal points along `theta` it says
//! `rho = p · n(theta) + r cos(eps)`, where p is the sensor's place, r the range and eps how far the normal lies outside the cone
//! (0 where it lies within; r cos(theta − beam) for a point beam). Each return votes for that rho under every theta, folded modulo
//! 90 degrees because in an orthogonal building all four wall directions vote together; the theta under which the
//! votes gather in the fewest rho wins. This is the paper's step from Hough lines to orientation (7)(8), with arcs instead of points.

use crate::geometry::{Placement, Point, nearest_quarter};
use crate::sweep::Beam;
use std::f64::consts::FRAC_PI_2;

/// The axis found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Direction of the axis that lies nearest to the frame's x axis, in (−45, 45] degrees, as radians.
    pub angle_rad: f64,
    /// How much better the best direction is than the median one; 1 is no preference.
    pub contrast: f64,
    /// How much better it is than the best one that lies apart from it, as furniture set at an angle has.
    pub peak_ratio: f64,
    /// How strongly the votes gather under it; comparable between the same returns laid out differently.
    pub strength: f64,
}

/// A direction is believed when its votes gather this much better than the median direction's.
const CONTRAST: f64 = 1.25;

impl Axis {
    /// True where the returns prefer this direction clearly enough to steer by.
    #[must_use]
    pub fn is_believed(&self) -> bool {
        self.contrast >= CONTRAST
    }
}

/// One return.
#[derive(Clone, Copy, Debug)]
struct Arc {
    origin: Point,
    direction_rad: f64,
    half_angle_rad: f64,
    range_m: f64,
}

/// Gathers returns and finds the axis they agree on.
#[derive(Clone, Debug)]
pub struct DominantDirections {
    arcs: Vec<Arc>,
    /// By the side that the wall is heard on.
    votes: Box<[[f32; RHO_BINS]; 4]>,
    scores: [f64; DIRECTIONS],
}

const DIRECTIONS: usize = 90;
const STEP_RAD: f64 = FRAC_PI_2 / DIRECTIONS as f64;
const RHO_STEP_M: f64 = 0.03;
const RHO_BINS: usize = 512;
/// Farther outside the cone a wall is not heard by a sonar.
const OBLIQUE_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Directions on each side of a known one that are looked at anew.
const NEAR: usize = 8;
/// Directions on each side of the best that shape its peak.
const PEAK: usize = 6;
/// Directions on each side of the best that are its own flank.
const APART: usize = 15;

impl Default for DominantDirections {
    fn default() -> Self {
        Self { arcs: Vec::new(), votes: Box::new([[0.0; RHO_BINS]; 4]), scores: [0.0; DIRECTIONS] }
    }
}

impl DominantDirections {
    /// Adds a beam seen from the robot at `frame_from_robot`; beams without a distance say nothing.
    pub fn add(&mut self, frame_from_robot: impl Into<Placement>, beam: &Beam) {
        if beam.has_range() {
            let sensor = frame_from_robot.into() * beam.robot_from_sensor;
            self.arcs.push(Arc {
                origin: sensor.position(),
                direction_rad: sensor.theta_rad,
                half_angle_rad: beam.half_angle_rad,
                range_m: beam.range_m,
            });
        }
    }

    /// Forgets the returns.
    pub fn clear(&mut self) {
        self.arcs.clear();
    }

    /// The axis that the returns agree on best; none without returns.
    pub fn find(&mut self) -> Option<Axis> {
        let centre = self.arcs.last()?.origin;
        for index in 0..DIRECTIONS {
            self.scores[index] = self.score(index as f64 * STEP_RAD, centre);
        }
        let mut sorted = self.scores;
        sorted.sort_by(f64::total_cmp);
        let (median, top) = (sorted[DIRECTIONS / 2], sorted[DIRECTIONS - 1]);
        let best = self.scores.iter().position(|score| *score >= top)?;
        let rival = self.rival(best);
        let offset = self.peak_offset(best);
        let angle_rad = (best as f64 + offset) * STEP_RAD;
        let folded = if angle_rad > 0.5 * FRAC_PI_2 { angle_rad - FRAC_PI_2 } else { angle_rad };
        (median > 0.0).then_some(Axis {
            angle_rad: folded,
            contrast: top / median,
            peak_ratio: top / rival,
            strength: top,
        })
    }

    /// How strongly the returns agree on the best direction within 8 degrees of `angle_rad`; none without returns.
    ///
    /// A fifth of the work of [`Self::find`], where only the same returns laid out a little differently are to be compared.
    pub fn find_near(&mut self, angle_rad: f64) -> Option<f64> {
        let centre = self.arcs.last()?.origin;
        let nearest = libm::round(angle_rad / STEP_RAD);
        let steps = (0..=2 * NEAR).map(|step| (nearest + step as f64 - NEAR as f64) * STEP_RAD);
        steps.map(|theta_rad| self.score(theta_rad, centre)).max_by(f64::total_cmp)
    }

    /// The best score of a direction that lies apart from the best one.
    fn rival(&self, best: usize) -> f64 {
        let apart = |index: usize| index.abs_diff(best).min(DIRECTIONS - index.abs_diff(best)) > APART;
        (0..DIRECTIONS).filter(|&index| apart(index)).map(|index| self.scores[index]).fold(0.0, f64::max)
    }

    /// How strongly the votes gather under one direction and its three perpendiculars. An arc votes for the one whose normal lies nearest: to
    /// the others it is more than 45 degrees.
    fn score(&mut self, theta_rad: f64, centre: Point) -> f64 {
        let (sin, cos) = libm::sincos(theta_rad);
        let normals = [(cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos)];
        self.votes.iter_mut().for_each(|votes| votes.fill(0.0));
        for arc in &self.arcs {
            let (side, off_rad) = nearest_quarter(arc.direction_rad - theta_rad);
            let off_rad = off_rad.abs() - arc.half_angle_rad;
            if off_rad > OBLIQUE_RAD {
                continue;
            }
            let depth_m = if off_rad > 0.0 { arc.range_m * cos_to_30_degrees(off_rad) } else { arc.range_m };
            let (cos, sin) = normals[side];
            let rho_m = (arc.origin.x - centre.x) * cos + (arc.origin.y - centre.y) * sin + depth_m;
            let place = rho_m / RHO_STEP_M + 0.5 * RHO_BINS as f64;
            if place >= 0.0 && place < (RHO_BINS - 1) as f64 {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the accumulator")]
                let bin = place as usize;
                #[expect(clippy::cast_possible_truncation, reason = "less than 1")]
                let part = (place - bin as f64) as f32;
                self.votes[side][bin] += 1.0 - part;
                self.votes[side][bin + 1] += part;
            }
        }
        self.votes.iter().map(|side| side.iter().map(|votes| f64::from(votes * votes)).sum::<f64>()).sum()
    }

    /// Where between the directions the peak lies: the vertex of a parabola through its neighbourhood.
    fn peak_offset(&self, best: usize) -> f64 {
        let (mut s2, mut s4, mut y0, mut y1, mut y2, mut n) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for k in 0..=2 * PEAK {
            let x = k as f64 - PEAK as f64;
            let y = self.scores[(best + DIRECTIONS + k - PEAK) % DIRECTIONS];
            (s2, s4, n) = (s2 + x * x, s4 + x.powi(4), n + 1.0);
            (y0, y1, y2) = (y0 + y, y1 + x * y, y2 + x * x * y);
        }
        let curvature = (n * y2 - s2 * y0) / (n * s4 - s2 * s2);
        let slope = y1 / s2;
        if curvature < 0.0 { (-0.5 * slope / curvature).clamp(-(PEAK as f64), PEAK as f64) } else { 0.0 }
    }
}

/// The cosine of an angle between −30 and 30 degrees to 3·10⁻⁹: its Taylor series, far cheaper than a call, and that it is the most often asked
/// here.
fn cos_to_30_degrees(angle_rad: f64) -> f64 {
    let square = angle_rad * angle_rad;
    1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose2, wrap_angle};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// The ring's ranges from the middle of a 4 x 3 m room turned by `turn`, heard through cones.
    fn room(turn_rad: f64, half_angle_rad: f64) -> DominantDirections {
        let mut finder = DominantDirections::default();
        for sensor in 0..32 {
            let bearing = TAU * f64::from(sensor) / 32.0;
            let range_m = [(0.0, 2.3), (1.0, 1.1), (2.0, 1.7), (3.0, 1.9)]
                .map(|(side, depth)| (wrap_angle(bearing - turn_rad - side * FRAC_PI_2).abs() - half_angle_rad, depth))
                .into_iter()
                .filter(|(off, _)| *off < OBLIQUE_RAD)
                .map(|(off, depth)| depth / libm::cos(off.max(0.0)))
                .fold(f64::INFINITY, f64::min);
            finder.add(
                Pose2::default(),
                &Beam {
                    range_m,
                    no_measurement: None,
                    age_s: 0.0,
                    robot_from_sensor: Pose2::new(0.0, 0.0, bearing),
                    half_angle_rad,
                },
            );
        }
        finder
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn turning_the_room_turns_the_axis(turn in -0.7..0.7f64, cone in prop::bool::ANY) {
            let half_angle = if cone { 12.5f64.to_radians() } else { 0.0 };
            let axis = room(turn, half_angle).find().unwrap();
            let error = wrap_angle(4.0 * (axis.angle_rad - turn)) / 4.0;
            prop_assert!(error.abs() < 3f64.to_radians(), "{} degrees off", error.to_degrees());
        }
    }

    #[test]
    fn nothing_heard_is_no_axis() {
        assert_eq!(DominantDirections::default().find(), None);
    }
}
