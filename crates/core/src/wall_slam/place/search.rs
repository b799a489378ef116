//! Finds a lost robot again, a little in each sweep, and only where nothing else is nearly as likely.

use super::field::Field;
use super::jump::Hands;
use super::monitor::{Record, Scene, Tally};
use super::params::{Params, SearchParams};
use super::scan::{Candidate, Return, Scan, refine};
use super::trail::{Step, Trail};
use crate::geometry::{Placement, Pose2, wrap_angle};
use crate::orientation::dominant_directions::{Axis, DominantDirections};
use crate::time::Timestamp;

/// The search for a lost robot.
#[derive(Debug)]
pub(in crate::wall_slam) struct PlaceSearch {
    /// Start of the uncertain poses.
    pub(in crate::wall_slam) since: Timestamp,
    /// Their last sweep before: walls learnt after it may be wrong.
    pub(in crate::wall_slam) since_sweep: u64,
    field: Field,
    /// `map_from_trail` as believed.
    believed: Pose2,
    /// What hands did to the robot: one that was carried is no likelier near the believed pose than elsewhere.
    hands: Option<Hands>,
    stage: Stage,
    /// The far pose that the last searches found one after the other.
    chain: Option<Chain>,
    ambiguity: Ambiguity,
    /// The way at the loss, metres, and `trail_from_robot`.
    lost_m: f64,
    lost_at: Pose2,
    /// The next scan begins at this way, metres.
    next_m: f64,
}

#[derive(Debug)]
enum Stage {
    Waiting,
    Scanning(Scan, Moment),
    Comparing(Comparison, Moment),
}

/// When a scan began.
#[derive(Clone, Copy, Debug)]
struct Moment {
    /// `trail_from_robot`.
    pose: Pose2,
    sweep: u64,
}

/// Candidates that are refined and compared.
#[derive(Debug)]
struct Comparison {
    left: Vec<Candidate>,
    returns: Vec<Return>,
    judged: Vec<Judgement>,
}

/// Searches in a row that agree.
#[derive(Clone, Copy, Debug)]
struct Chain {
    /// `map_from_trail`.
    pose: Pose2,
    /// The way at the first of them, metres.
    since_m: f64,
    finds: u32,
}

/// Where the robot may be.
#[derive(Clone, Copy, Debug)]
pub(in crate::wall_slam) struct Find {
    pub(in crate::wall_slam) pose: Pose2,
    /// It was pushed or never lost, rather than carried.
    pub(in crate::wall_slam) is_near: bool,
}

/// Whether two places explain the readings about equally well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ambiguity {
    None,
    Found,
    Told,
}

/// How a pose differs from the believed one where the robot was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Displacement {
    /// Hardly: the robot was pushed or never lost.
    Near,
    /// It was turned where it stands.
    Turned,
    /// It was carried.
    Far,
}

/// What the readings say of a pose.
#[derive(Clone, Copy, Debug)]
struct Judgement {
    /// `map_from_trail`.
    pose: Pose2,
    /// Log-likelihood ratio for it, nats.
    likelihood: f64,
    /// Share of the returns of which the map tells, and the explained share of those.
    told: f64,
    explained: f64,
}

/// Candidates that are refined and compared in one sweep.
const PER_SWEEP: usize = 6;

impl PlaceSearch {
    /// Begins with the robot believed at `pose`.
    pub(in crate::wall_slam) fn new(
        (since_sweep, since): (u64, Timestamp),
        pose: Pose2,
        hands: Option<Hands>,
        trail: &Trail,
        scene: &Scene<'_>,
    ) -> Self {
        Self {
            since,
            since_sweep,
            field: Field::new(scene.grid, scene.params),
            believed: pose * trail.pose().inverse(),
            hands,
            stage: Stage::Waiting,
            chain: None,
            ambiguity: Ambiguity::None,
            lost_m: trail.way_m(),
            lost_at: trail.pose(),
            next_m: f64::NEG_INFINITY,
        }
    }

    /// The believed pose, as the wheels have moved it.
    pub(in crate::wall_slam) fn believed(&self, trail: &Trail) -> Pose2 {
        self.believed * trail.pose()
    }

    /// Hands moved the robot again: what was heard before is from another place.
    pub(in crate::wall_slam) fn restart(&mut self, hands: Hands, trail: &Trail) {
        if !self.is_carried() {
            self.hands = Some(hands);
        }
        (self.stage, self.chain, self.next_m) = (Stage::Waiting, None, trail.way_m());
    }

    /// True the first time after a search in which two places explained the readings about equally well.
    pub(in crate::wall_slam) fn becomes_ambiguous(&mut self) -> bool {
        let is_new = self.ambiguity == Ambiguity::Found;
        if is_new {
            self.ambiguity = Ambiguity::Told;
        }
        is_new
    }

    fn is_carried(&self) -> bool {
        self.hands == Some(Hands::Carried)
    }

    /// Hands moved the robot a little.
    pub(in crate::wall_slam) fn is_pushed(&self) -> bool {
        self.hands == Some(Hands::Pushed)
    }

    /// A pose that was tried turned out to be wrong.
    pub(in crate::wall_slam) fn reject(&mut self, trail: &Trail, params: &Params) {
        self.chain = None;
        self.next_m = trail.way_m() + params.search.every_m;
    }

    /// Searches a little farther. Where the robot may be, once that is found.
    pub(in crate::wall_slam) fn step(
        &mut self,
        trail: &Trail,
        scene: &Scene<'_>,
        finder: &mut DominantDirections,
    ) -> Option<Find> {
        let params = scene.params;
        match std::mem::replace(&mut self.stage, Stage::Waiting) {
            Stage::Waiting => {
                let first_m = trail.since(self.since_sweep).next().map_or_else(|| trail.way_m(), |step| step.way_m);
                if trail.way_m() - first_m >= params.search.first_m && trail.way_m() >= self.next_m {
                    self.next_m = trail.way_m() + params.search.every_m;
                    self.stage = self.begin(trail, finder, params);
                }
                None
            }
            Stage::Scanning(mut scan, moment) => {
                self.stage = if scan.step(&self.field, params) {
                    let (left, returns) = scan.finish();
                    Stage::Comparing(Comparison { left, returns, judged: Vec::new() }, moment)
                } else {
                    Stage::Scanning(scan, moment)
                };
                None
            }
            Stage::Comparing(mut comparison, moment) => {
                for _ in 0..PER_SWEEP {
                    let Some(candidate) = comparison.left.pop() else {
                        let found = self.decide(&comparison.judged, &moment, trail, params);
                        return found
                            .map(|(map_from_trail, is_near)| Find { pose: map_from_trail * trail.pose(), is_near });
                    };
                    let refined = refine(&self.field, &comparison.returns, candidate);
                    let pose = refined.pose * moment.pose.inverse();
                    let steps = trail.since(self.since_sweep).filter(|step| step.sweep <= moment.sweep);
                    comparison.judged.push(judge(scene, steps, pose));
                }
                self.stage = Stage::Comparing(comparison, moment);
                None
            }
        }
    }

    /// Begins a scan with the readings so far.
    fn begin(&self, trail: &Trail, finder: &mut DominantDirections, params: &Params) -> Stage {
        let steps = trail.since(self.since_sweep);
        let count: usize = steps.clone().map(|step| returns(step).count()).sum();
        let Some(newest) = steps.clone().last().filter(|_| count > 0) else { return Stage::Waiting };
        let moment = Moment { pose: newest.pose, sweep: newest.sweep };
        finder.clear();
        for step in steps.clone() {
            step.beams.iter().for_each(|beam| finder.add(step.pose, beam));
        }
        let axis = finder.find().filter(Axis::is_believed);
        finder.clear();
        let robot_from_trail = newest.pose.inverse();
        let stride = count.div_ceil(params.search.scanned);
        let all = steps.flat_map(|step| {
            let robot_from_step = Placement::from(robot_from_trail * step.pose);
            returns(step).map(move |beam| Return {
                robot_from_sensor: robot_from_step * beam.robot_from_sensor,
                half_angle_rad: beam.half_angle_rad,
                range_m: beam.range_m,
            })
        });
        let chosen = all.step_by(stride).collect();
        let heading_rad = axis.map(|axis| newest.pose.theta_rad - axis.angle_rad);
        let believed = self.believed * newest.pose;
        Stage::Scanning(Scan::new(chosen, believed, heading_rad, &self.field, params), moment)
    }

    /// Compares where the robot was lost: later the places part if it was turned.
    fn displacement(&self, map_from_trail: Pose2, search: &SearchParams) -> Displacement {
        let (a, b) = (map_from_trail * self.lost_at, self.believed * self.lost_at);
        let moved_m = (a.position() - b.position()).norm();
        let turned_rad = wrap_angle(a.theta_rad - b.theta_rad).abs();
        match turned_rad {
            _ if self.is_carried() || moved_m >= search.near_m => Displacement::Far,
            rad if rad < search.near_rad => Displacement::Near,
            rad if rad < search.turned_rad => Displacement::Turned,
            _ => Displacement::Far,
        }
    }

    /// `map_from_trail`, if one pose stands out, and whether it is near the believed one.
    fn decide(
        &mut self,
        judged: &[Judgement],
        moment: &Moment,
        trail: &Trail,
        params: &Params,
    ) -> Option<(Pose2, bool)> {
        let search = &params.search;
        let apart = |a: Pose2, b: Pose2| {
            let (a, b) = (a * moment.pose, b * moment.pose);
            ((a.position() - b.position()).norm(), wrap_angle(a.theta_rad - b.theta_rad).abs())
        };
        let displacement = |one: &Judgement| self.displacement(one.pose, search);
        let posterior = |one: &Judgement| one.likelihood + search.log_prior(displacement(one));
        let likeliest = |one: &&Judgement, other: &&Judgement| posterior(one).total_cmp(&posterior(other));
        // The best of what explains so much and lies elsewhere than `from`.
        let rival = |from: Pose2, min_explained: f64| {
            let is_elsewhere = |other: &&Judgement| {
                let (m, rad) = apart(from, other.pose);
                other.explained >= min_explained && (m > search.apart_m || rad > search.apart_rad)
            };
            judged.iter().filter(is_elsewhere).map(posterior).fold(-search.carried_penalty, f64::max)
        };
        let is_near = |one: &&Judgement| {
            let min_explained = match displacement(one) {
                Displacement::Near => search.min_near_explained,
                Displacement::Turned => search.min_turned_explained,
                Displacement::Far => return false,
            };
            one.explained >= min_explained && one.told >= search.min_near_told
        };
        if trail.way_m() < self.lost_m + search.near_until_m
            && let Some(near) = judged.iter().filter(is_near).max_by(likeliest)
            && posterior(near) >= rival(near.pose, search.min_explained) + search.min_near_lead
        {
            return Some((near.pose, true));
        }
        let fits = |one: &&Judgement| one.explained >= search.min_explained && one.told >= search.min_told;
        let best = judged.iter().filter(fits).max_by(likeliest)?;
        // What explains less may still be the true place, among things that were moved.
        let lead = posterior(best) - rival(best.pose, search.rival_explained);
        if lead < search.min_lead.max(search.min_lead_share * best.likelihood) {
            if self.ambiguity == Ambiguity::None {
                self.ambiguity = Ambiguity::Found;
            }
            return None;
        }
        let way_m = trail.way_m();
        let (since_m, finds) = match self.chain {
            Some(Chain { pose, since_m, finds }) => {
                let (m, rad) = apart(best.pose, pose);
                if m < search.same_m && rad < search.same_rad { (since_m, finds + 1) } else { (way_m, 1) }
            }
            None => (way_m, 1),
        };
        self.chain = Some(Chain { pose: best.pose, since_m, finds });
        (finds >= search.min_finds && way_m - since_m >= search.again_m).then_some((best.pose, false))
    }
}

impl SearchParams {
    /// The log prior of a pose, nats.
    const fn log_prior(&self, displacement: Displacement) -> f64 {
        match displacement {
            Displacement::Near => 0.0,
            Displacement::Turned => -self.turned_penalty,
            Displacement::Far => -self.carried_penalty,
        }
    }
}

fn returns(step: &Step) -> impl Iterator<Item = &crate::sweep::Beam> {
    step.beams.iter().filter(|beam| beam.has_range())
}

/// What the readings of the steps say of a pose.
fn judge<'a>(scene: &Scene<'_>, steps: impl Iterator<Item = &'a Step>, map_from_trail: Pose2) -> Judgement {
    let (mut likelihood, mut record) = (0.0, Record::default());
    let mut before_m: Option<f64> = None;
    for step in steps {
        let way_m = before_m.map_or(0.0, |before_m| step.way_m - before_m).min(scene.params.max_step_m);
        before_m = Some(step.way_m);
        let pose = Placement::from(map_from_trail * step.pose);
        let stride = (step.beams.len() / scene.params.max_beams).max(1);
        let first = usize::try_from(step.sweep).unwrap_or(0) % stride;
        let mut tally = Tally::default();
        for beam in step.beams.iter().skip(first).step_by(stride) {
            scene.add(&mut tally, pose * beam.robot_from_sensor, beam);
        }
        likelihood -= scene.evidence(&tally, way_m);
        record.add(&tally, way_m);
    }
    Judgement { pose: map_from_trail, likelihood, told: record.told(), explained: record.explained() }
}
