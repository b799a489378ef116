//! The heading as the walls measure it: on each wall, how the misfits of its beams grow with a turn.

use super::ekf_slam::{Association, EkfSlam};

/// How far the heading was off an axis that was read from the way behind the robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisReading {
    /// The axis's heading less the filter's, radians.
    pub(crate) angle_rad: f64,
    /// Its variance as one of the readings of a window, rad², if the wheels are right; and as the only one.
    pub(crate) variance: f64,
    pub(crate) window_variance: f64,
    /// The way ahead from the middle of the window to the robot, metres, and the turn on it, radians.
    pub(crate) lag: [f64; 2],
}

/// The heading as the walls measure it.
struct HeadingObservation {
    innovation_rad: f64,
    variance: f64,
    /// The beams that measure it.
    beams: usize,
}

impl EkfSlam {
    /// Corrects the heading. Returns the normalised innovation squared; none without a measurement within the gate.
    pub(super) fn update_heading(&mut self) -> Option<f64> {
        let params = self.params.slam;
        let HeadingObservation { innovation_rad, variance, beams } = self.observe_heading()?;
        let heading_variance = self.filter.pose_covariance()[(2, 2)];
        let normalised = innovation_rad / (heading_variance + variance).sqrt();
        self.stated_errors.add(2, normalised);
        let factor = self.whiteness.variance_factor(normalised);
        let variance = if beams <= params.few_beams { variance * factor } else { variance };
        let nis = innovation_rad.powi(2) / (heading_variance + variance);
        self.filter.adapt_slip(nis);
        (nis < params.heading_gate_sigma * params.heading_gate_sigma).then(|| {
            self.filter.update_heading(innovation_rad, variance);
            nis
        })
    }

    /// Corrects the heading with the building's axis.
    pub(crate) fn correct_heading(&mut self, turn: &AxisReading) {
        let [ahead_m, turned_rad] = turn.lag;
        let way_m = libm::hypot(ahead_m, 0.5 * self.filter.nominal.wheel_base_m * turned_rad);
        let wheels = self.filter.wheel_heading_variance(way_m);
        let once = self.filter.pose_covariance()[(2, 2)] + wheels + turn.window_variance;
        // The filter is surer than it may be: walls that are none, or a slip that it does not know of.
        let excess = turn.angle_rad.powi(2) - self.params.slam.axis_gate_sigma.powi(2) * once;
        self.filter.doubt_heading(excess.max(0.0));
        let variance = turn.variance + wheels;
        self.filter.update_lagging_heading(turn.angle_rad, variance, turn.lag);
    }

    /// The heading from the beams: on each wall, the slope of their misfits over their derivative by the heading.
    fn observe_heading(&self) -> Option<HeadingObservation> {
        let (mut information, mut sum, mut beams) = (0.0, 0.0, 0);
        for &wall in &self.observed {
            let (mut w, mut wh, mut whh, mut wz, mut whz, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0);
            for (association, index) in self.associations.iter().zip(&self.wall_of_beam) {
                let (Association::Wall(observation), true) = (association, *index == Some(wall)) else { continue };
                let m = self.measure(observation, wall);
                let (weight, h) = (1.0 / m.variance, m.robot[2]);
                w += weight;
                wh += weight * h;
                whh += weight * h * h;
                wz += weight * m.innovation;
                whz += weight * h * m.innovation;
                count += 1;
            }
            // A slope takes two beams.
            if count > 1 {
                beams += count;
                information += whh - wh * wh / w;
                sum += whz - wh * wz / w;
            }
        }
        let params = &self.params.slam;
        let variance = 1.0 / information + params.heading_sigma_rad * params.heading_sigma_rad;
        (information > params.min_heading_information).then(|| HeadingObservation {
            innovation_rad: sum / information,
            variance,
            beams,
        })
    }
}
