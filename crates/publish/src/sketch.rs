//! What the picture shows of a run's poses, gathered as they come; it can be drawn at any time.

use super::picture::{self, Drive, Scene, Stretch};
use super::plan::Plan;
use super::track::Track;
use nalgebra::Matrix3;
use slamd_core::{Estimate, LocalizationEvent, Point, Pose2, Raster, Ring, SensorState, Timestamp};
use std::io;

/// The path so far, in bounded memory.
#[derive(Clone, Debug, Default)]
pub struct Sketch {
    path: Track,
    odometry: Track,
    map_from_odom: Option<Pose2>,
    pose: Pose2,
    /// The bound of the position's error at the newest pose, metres, and whether that pose was certain when it came.
    within_m: Option<(f64, bool)>,
    /// The greatest bound of certain poses before it.
    greatest_within_m: f64,
    /// Nothing is said of the position's error.
    is_unbounded: bool,
    /// The intervals whose poses were uncertain, in order.
    uncertain: Vec<(Timestamp, Timestamp)>,
    /// Since when poses are uncertain, while they are.
    uncertain_since: Option<Timestamp>,
}

/// What the filter does not know of the position, metres: cells of 5 cm, echoes of cones, furniture. Chosen with [`FRAME_RAD`]; without it
/// the bound is below the error of a robot that stays near its start.
const FLOOR_M: f64 = 0.02;
/// What neither robot nor filter knows of the map as a whole: the heading of the first pose against the walls (radians), and the speed of sound
/// (10 K are 1.8 %). An error grows by this share of the way from the origin. Of 11 simulated drives of 150 s in homes, offices and furnished
/// rooms (8 to 32 sensors), the error was 0.4 to 3 % of that distance, 1.6 % in the mean square.
const FRAME_RAD: f64 = 0.02;
/// 95 % of a normal distribution lie within so many standard deviations.
const SIGMAS: f64 = 2.0;

/// More intervals count as one with the last.
const MAX_INTERVALS: usize = 1_000;

/// What else is in the picture.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// The map.
    pub raster: &'a Raster,
    /// Where the sensors sit.
    pub ring: &'a Ring,
    /// The sensors' states, by id.
    pub states: &'a [SensorState],
    /// The robot's name.
    pub robot_name: &'a str,
    /// What is doubtful, one sentence each; they stand below the legend.
    pub doubts: &'a [String],
    /// Unix time of the session's start, microseconds; none if unknown.
    pub began_unix_us: Option<u64>,
}

/// The picture of a sketch: the map as a floor plan, and the path over it.
pub struct Drawing<'a> {
    around: Surroundings<'a>,
    plan: Plan,
    drive: Drive,
    path: Vec<Stretch>,
    path_m: f64,
    odometry: Vec<Point>,
    pose: Pose2,
    truth: &'a [Point],
    ate_m: Option<f64>,
}

impl<'a> Drawing<'a> {
    /// Adds the true path in the map frame, and how far off ours is, metres.
    pub(super) fn with_truth(self, truth: &'a [Point], ate_m: Option<f64>) -> Self {
        Self { truth, ate_m, ..self }
    }

    /// The area of the rooms that walls close, square metres.
    #[must_use]
    pub fn floor_m2(&self) -> f64 {
        self.plan.floor_m2()
    }

    /// The rooms, each with its free area in square metres, the largest first.
    pub fn rooms_m2(&self) -> impl Iterator<Item = f64> + '_ {
        self.plan.rooms.iter().map(|room| room.area_m2)
    }

    /// The picture as a PNG file, like `map.png`.
    ///
    /// # Errors
    /// Where the picture is too large for the format.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        picture::draw(&self.scene())
    }

    /// The picture as an SVG file, like `map.svg`.
    #[must_use]
    pub fn svg(&self) -> String {
        picture::draw_svg(&self.scene())
    }

    /// Pictures without a map, with the reason in words: PNG and SVG.
    pub(super) fn reason(&self, reason: &str) -> io::Result<(Vec<u8>, String)> {
        let scene = self.scene();
        Ok((picture::draw_reason(&scene, reason)?, picture::draw_reason_svg(&scene, reason)))
    }

    fn scene(&self) -> Scene<'_> {
        let Surroundings { raster, ring, states, robot_name, doubts, .. } = self.around;
        Scene {
            raster,
            plan: &self.plan,
            drive: self.drive,
            path: &self.path,
            path_m: self.path_m,
            odometry: &self.odometry,
            truth: self.truth,
            ate_m: self.ate_m,
            pose: self.pose,
            ring,
            states,
            robot_name,
            doubts,
        }
    }
}

impl Sketch {
    /// The robot's newest pose.
    pub fn estimate(&mut self, estimate: &Estimate) {
        let map_from_odom = *self.map_from_odom.get_or_insert_with(|| estimate.pose * estimate.odometry.inverse());
        self.path.push(estimate.at, estimate.pose.position());
        self.odometry.push(estimate.at, (map_from_odom * estimate.odometry).position());
        self.pose = estimate.pose;
        // A pose counts once the next has come, for it may be called uncertain after it came.
        self.greatest_within_m = self.within()[1];
        self.within_m = Some((within_m(estimate), self.uncertain_since.is_none()));
    }

    /// The bound at the newest pose and the greatest, metres.
    fn within(&self) -> [f64; 2] {
        let (last_m, was_certain) = self.within_m.unwrap_or_default();
        let counts = was_certain && self.uncertain_since.is_none();
        [last_m, if counts { self.greatest_within_m.max(last_m) } else { self.greatest_within_m }]
    }

    /// In 19 of 20 cases the true position is within this distance, metres: at the newest pose, and the greatest of all certain poses. None
    /// without a certain pose.
    #[must_use]
    pub fn within_m(&self) -> Option<[f64; 2]> {
        Some(self.within()).filter(|[_, greatest_m]| *greatest_m > 0.0 && !self.is_unbounded)
    }

    /// The poses are those of a method whose covariance says little of their error: the published one is lost without a word.
    pub(super) const fn without_bound(mut self) -> Self {
        self.is_unbounded = true;
        self
    }

    /// Forgets the path in a discarded map; poses that are uncertain now are so from here on.
    pub(super) fn begin_anew(&mut self, at: Timestamp) {
        let uncertain_since = self.uncertain_since.map(|_| at);
        *self = Self { uncertain_since, ..Self::default() };
    }

    /// The pose became uncertain, from an earlier instant on, or known again.
    pub fn localization(&mut self, event: &LocalizationEvent) {
        self.set_uncertain(event.is_lost(), if event.is_lost() { event.since } else { event.at });
    }

    /// Poses from `at` on are uncertain, or known again. The path is dashed where they are uncertain.
    pub fn set_uncertain(&mut self, is_uncertain: bool, at: Timestamp) {
        if is_uncertain {
            self.uncertain_since.get_or_insert(at);
        } else if let Some(since) = self.uncertain_since.take() {
            let is_full = self.uncertain.len() >= MAX_INTERVALS;
            match self.uncertain.last_mut() {
                Some((_, end)) if is_full => *end = at,
                _ => self.uncertain.push((since, at)),
            }
        }
    }

    /// The length of the whole path, metres.
    #[must_use]
    pub const fn path_m(&self) -> f64 {
        self.path.length_m()
    }

    /// The time of the newest pose.
    pub(super) fn last_at(&self) -> Option<Timestamp> {
        self.path.last_at()
    }

    /// The picture of everything so far.
    #[must_use]
    pub fn drawing<'a>(&self, around: Surroundings<'a>) -> Drawing<'a> {
        let path = self.stretches();
        // Where the pose was uncertain, the robot may have been elsewhere.
        let certain = path.iter().filter(|stretch| !stretch.is_uncertain).map(|stretch| stretch.points.as_slice());
        let plan = Plan::new(around.raster, certain);
        let drive = Drive {
            began_unix_us: around.began_unix_us,
            duration_s: self.last_at().map_or(0.0, Timestamp::seconds),
            within_m: self.within_m(),
            uncertain_s: self.uncertain_s(),
            is_lost: self.uncertain_since.is_some(),
        };
        let (path_m, odometry, pose) = (self.path_m(), self.odometry.points(), self.pose);
        Drawing { around, plan, drive, path, path_m, odometry, pose, truth: &[], ate_m: None }
    }

    /// Seconds of uncertain poses.
    fn uncertain_s(&self) -> f64 {
        let open = self.uncertain_since.zip(self.last_at()).filter(|(since, last)| last > since);
        self.uncertain.iter().copied().chain(open).map(|(since, end)| end.seconds_since(since)).sum()
    }

    /// The path, cut where it becomes uncertain or certain. Neighbours share a point; the step between them is uncertain.
    fn stretches(&self) -> Vec<Stretch> {
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut intervals = self.uncertain.iter().copied();
        let open = self.uncertain_since.map(|since| (since, Timestamp::from_us(u64::MAX)));
        let mut interval = intervals.next().or(open);
        for (at, point) in self.path.timed() {
            while interval.is_some_and(|(_, end)| end <= at) {
                interval = intervals.next().or(open);
            }
            let is_uncertain = interval.is_some_and(|(since, _)| since <= at);
            match stretches.last_mut() {
                Some(last) if last.is_uncertain == is_uncertain => last.points.push(point),
                Some(last) if last.is_uncertain => {
                    last.points.push(point);
                    stretches.push(Stretch { is_uncertain, points: vec![point] });
                }
                Some(last) => {
                    let joint = last.points.last().copied();
                    stretches.push(Stretch { is_uncertain, points: joint.into_iter().chain([point]).collect() });
                }
                None => stretches.push(Stretch { is_uncertain, points: vec![point] }),
            }
        }
        stretches
    }
}

/// The distance from the estimated position within which the true one lies in 19 of 20 cases, metres.
fn within_m(estimate: &Estimate) -> f64 {
    let far_m = estimate.pose.position().coords.norm();
    let sigma_m = [position_sigma_m(&estimate.covariance), FLOOR_M, FRAME_RAD * far_m];
    SIGMAS * sigma_m.iter().map(|sigma_m| sigma_m * sigma_m).sum::<f64>().sqrt()
}

/// Standard deviation of x and y along their least certain direction, metres: the root of the covariance's greater eigenvalue.
fn position_sigma_m(covariance: &Matrix3<f64>) -> f64 {
    let [xx, yy, xy] = [covariance[(0, 0)], covariance[(1, 1)], covariance[(0, 1)]];
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    (mean + (half * half + xy * xy).sqrt()).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::LocalizationChange;

    #[test]
    fn the_path_is_cut_where_it_is_uncertain() {
        let at = |s: u64| Timestamp::from_us(1_000_000 * s);
        let mut sketch = Sketch::default();
        for s in 0..10u32 {
            let pose = Pose2::new(f64::from(s), 0.0, 0.0);
            let (sweep, covariance) = (u64::from(s), Matrix3::zeros());
            sketch.estimate(&Estimate { at: at(sweep), sweep, pose, covariance, odometry: pose, nis: 1.0 });
            if s == 4 {
                let change = LocalizationChange::Lost;
                sketch.localization(&LocalizationEvent { at: at(4), since: at(3), change });
            } else if s == 6 {
                let change = LocalizationChange::Regained { moved_m: 1.0, turned_rad: 0.0 };
                sketch.localization(&LocalizationEvent { at: at(6), since: at(3), change });
            } else if s == 8 {
                sketch.localization(&LocalizationEvent { at: at(8), since: at(8), change: LocalizationChange::Lost });
            }
        }
        let cut: Vec<(bool, f64, f64)> = sketch
            .stretches()
            .iter()
            .map(|stretch| (stretch.is_uncertain, stretch.points[0].x, stretch.points[stretch.points.len() - 1].x))
            .collect();
        assert_eq!(cut, [(false, 0.0, 2.0), (true, 2.0, 6.0), (false, 6.0, 7.0), (true, 7.0, 9.0)]);
    }
}
