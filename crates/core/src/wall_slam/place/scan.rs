//! Lays the returns of a lost robot out on the map, at every floor cell under each possible heading and, finer, around the believed pose.
//!
//! A return ends on the arc at its range, most likely where the arc faces a wall: there and at two other points of the arc the field's
//! mark is read, and the best counts.

use super::field::{Field, PERFECT};
use super::params::Params;
use crate::geometry::{Placement, Point, Pose2, nearest_quarter, wrap_angle};

/// A return as seen from the robot's last pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Return {
    pub(super) robot_from_sensor: Pose2,
    pub(super) half_angle_rad: f64,
    pub(super) range_m: f64,
}

/// A pose, and how well the returns' ends lie on surfaces: 1 is perfect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    pub(super) pose: Pose2,
    pub(super) fit: f64,
}

/// A scan that goes on over several sweeps.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    returns: Vec<Return>,
    layouts: Vec<Layout>,
    /// Cells around the believed pose.
    near: Vec<[i32; 2]>,
    /// The layout and cell to score next.
    next: (usize, usize),
    best: Vec<Candidate>,
}

/// The ends of the returns under one heading, in cells from the robot.
#[derive(Clone, Debug)]
struct Layout {
    heading_rad: f64,
    is_near: bool,
    ends: Vec<[[i32; 2]; 3]>,
}

impl Scan {
    /// A scan around `believed`, and everywhere under the headings of the building's axis if that is known.
    pub(super) fn new(
        returns: Vec<Return>,
        believed: Pose2,
        heading_rad: Option<f64>,
        field: &Field,
        params: &Params,
    ) -> Self {
        let search = &params.search;
        let mut layouts = Vec::new();
        let mut add = |heading_rad: f64, is_near: bool| {
            let ends = returns.iter().map(|a| a.ends(heading_rad).map(|end| field.steps(end))).collect();
            layouts.push(Layout { heading_rad, is_near, ends });
        };
        let mut turn_rad = -search.near_rad;
        while turn_rad < search.near_rad + 0.5 * search.near_step_rad {
            add(wrap_angle(believed.theta_rad + turn_rad), true);
            turn_rad += search.near_step_rad;
        }
        for quarter in 0..4 {
            if let Some(heading_rad) = heading_rad {
                add(wrap_angle(heading_rad + f64::from(quarter) * std::f64::consts::FRAC_PI_2), false);
            }
        }
        let near = field.around(believed.position(), search.near_m, search.pitch_m);
        let best = vec![Candidate { pose: believed, fit: fit(field, &returns, believed) }];
        Self { returns, layouts, near, next: (0, 0), best }
    }

    /// Scores the next poses. True once all are done.
    pub(super) fn step(&mut self, field: &Field, params: &Params) -> bool {
        for _ in 0..params.search.per_sweep {
            let (layout, cell) = self.next;
            let Some(Layout { heading_rad, is_near, ends }) = self.layouts.get(layout) else { return true };
            let cells = if *is_near { &self.near } else { &field.floor };
            let Some(&at) = cells.get(cell) else {
                self.next = (layout + 1, 0);
                continue;
            };
            self.next.1 += 1;
            let worst = if self.best.len() < params.search.candidates {
                0.0
            } else {
                self.best.iter().map(|candidate| candidate.fit).fold(f64::INFINITY, f64::min)
            };
            let fit = score(field, ends, at);
            if fit > worst {
                let point = field.middle(at);
                let pose = Pose2::new(point.x, point.y, *heading_rad);
                keep(&mut self.best, Candidate { pose, fit }, params);
            }
        }
        false
    }

    /// The best poses, and the returns to refine them with.
    pub(super) fn finish(self) -> (Vec<Candidate>, Vec<Return>) {
        (self.best, self.returns)
    }
}

/// Keeps the best of neighbouring poses, and the best places.
fn keep(best: &mut Vec<Candidate>, new: Candidate, params: &Params) {
    let search = &params.search;
    let is_same = |old: &&mut Candidate| {
        (old.pose.position() - new.pose.position()).norm() < 0.5 * search.apart_m
            && wrap_angle(old.pose.theta_rad - new.pose.theta_rad).abs() < search.apart_rad
    };
    if let Some(old) = best.iter_mut().skip(1).find(is_same) {
        if new.fit > old.fit {
            *old = new;
        }
    } else if best.len() < search.candidates {
        best.push(new);
    } else if let Some(worst) = best.iter_mut().skip(1).min_by(|a, b| a.fit.total_cmp(&b.fit))
        && new.fit > worst.fit
    {
        *worst = new;
    }
}

fn score(field: &Field, ends: &[[[i32; 2]; 3]], [x, y]: [i32; 2]) -> f64 {
    let mark = |[dx, dy]: [i32; 2]| field.mark(x + dx, y + dy);
    let total: i32 = ends.iter().map(|[facing, a, b]| mark(*facing).max(mark(*a).max(mark(*b)) - 1)).sum();
    f64::from(total) / (f64::from(PERFECT) * ends.len().max(1) as f64)
}

/// How well the returns fit at any pose.
fn fit(field: &Field, returns: &[Return], pose: Pose2) -> f64 {
    let [x, y] = field.cells(pose.position());
    #[expect(clippy::cast_possible_truncation, reason = "a cell")]
    let mark = |end: Point| {
        let [dx, dy] = [end.x / field.cell_m, end.y / field.cell_m];
        field.mark(libm::floor(x + dx) as i32, libm::floor(y + dy) as i32)
    };
    let total: i32 = returns
        .iter()
        .map(|a| {
            let [facing, left, right] = a.ends(pose.theta_rad);
            mark(facing).max(mark(left).max(mark(right)) - 1)
        })
        .sum();
    f64::from(total) / (f64::from(PERFECT) * returns.len().max(1) as f64)
}

/// Climbs from a pose to the best one beside it.
pub(super) fn refine(field: &Field, returns: &[Return], from: Candidate) -> Candidate {
    let mut best = Candidate { fit: fit(field, returns, from.pose), ..from };
    for (step_m, step_rad) in [(0.05, 0.03), (0.025, 0.012)] {
        for _ in 0..6 {
            let Pose2 { x_m, y_m, theta_rad } = best.pose;
            let mut is_better = false;
            for [dx, dy, turn] in [
                [1.0, 0.0, 0.0],
                [-1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, -1.0, 0.0],
                [0.0, 0.0, 1.0],
                [0.0, 0.0, -1.0],
            ] {
                let pose = Pose2::new(x_m + dx * step_m, y_m + dy * step_m, theta_rad + turn * step_rad);
                let fit = fit(field, returns, pose);
                if fit > best.fit {
                    best = Candidate { pose, fit };
                    is_better = true;
                }
            }
            if !is_better {
                break;
            }
        }
    }
    best
}

impl Return {
    /// Where it may end if the robot has this heading, metres from the robot: facing a wall, and at two other points of the arc.
    fn ends(&self, heading_rad: f64) -> [Point; 3] {
        let sensor = Placement::from(Pose2::new(0.0, 0.0, heading_rad)) * self.robot_from_sensor;
        let (_, off_rad) = nearest_quarter(sensor.theta_rad);
        let half_rad = self.half_angle_rad;
        [-off_rad.clamp(-half_rad, half_rad), 0.6 * half_rad, -0.6 * half_rad]
            .map(|turn_rad| Pose2 { theta_rad: sensor.theta_rad + turn_rad, ..sensor }.ahead(self.range_m))
    }
}

impl Field {
    #[expect(clippy::cast_possible_truncation, reason = "some dozens of cells")]
    fn steps(&self, end: Point) -> [i32; 2] {
        [libm::round(end.x / self.cell_m) as i32, libm::round(end.y / self.cell_m) as i32]
    }

    /// The cells within a square around a point.
    #[expect(clippy::cast_possible_truncation, reason = "some dozens of cells")]
    fn around(&self, point: Point, reach_m: f64, pitch_m: f64) -> Vec<[i32; 2]> {
        let [x, y] = self.cells(point).map(|cell| libm::floor(cell) as i32);
        let pitch = libm::round(pitch_m / self.cell_m).max(1.0) as i32;
        let reach = libm::round(reach_m / pitch_m) as i32;
        let steps = -reach..=reach;
        steps.clone().flat_map(|row| steps.clone().map(move |column| [x + column * pitch, y + row * pitch])).collect()
    }
}
