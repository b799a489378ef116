//! Searches for a robot under which the walls are sharper than under the believed one.
//!
//! A few alternatives per sweep are laid out over the window of the latest metres, so the search costs a bounded time per sweep and
//! never ends. A round is over when each alternative had its turn. Its best one, refined, adds `ln(ratio) - ln(fits_ratio)` to the
//! evidence. Enough evidence makes it a suspect; the window is emptied, and returns that the first finding has not seen must confirm it.

use super::concentration::{self, Concentration};
use super::hypothesis::{RobotModel, Sensor, motion};
use super::params::Params;
use super::window::Window;
use crate::geometry::{Ring, wrap_angle};
use crate::sweep::Sweep;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// What the walls say of the believed robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// There are too few returns since the last answer.
    Open,
    /// No other robot makes the walls sharper.
    Fits,
    /// Another one does, so far.
    Suspected,
    /// This one does.
    Found(RobotModel),
}

/// The check of the believed robot.
#[derive(Clone, Debug)]
pub(super) struct ModelCheck {
    params: Params,
    configured: Ring,
    base_m: f64,
    window: Window,
    concentration: Concentration,
    /// The sensors of the hypothesis at hand.
    sensors: Vec<Sensor>,
    /// The next alternative, and the best of this round with the log of its ratio to the believed one.
    next: usize,
    best: Option<(f64, RobotModel)>,
    evidence: f64,
    /// The robot to be confirmed, and the log of its ratio when it was found.
    suspect: Option<(RobotModel, f64)>,
    /// Sweeps since the believed robot was last wrong, and of this round.
    fitting_keys: u64,
    round_keys: u64,
    /// How far it has turned since the believed robot was last wrong, radians.
    fitting_rad: f64,
    confirming_keys: u64,
}

impl ModelCheck {
    pub(super) fn new(configured: &Ring, base_m: f64, params: &Params) -> Self {
        Self {
            params: *params,
            configured: configured.clone(),
            base_m,
            window: Window::new(params),
            concentration: Concentration::new(params),
            sensors: Sensor::of(configured),
            next: 0,
            best: None,
            evidence: 0.0,
            suspect: None,
            fitting_keys: 0,
            round_keys: 0,
            fitting_rad: 0.0,
            confirming_keys: 0,
        }
    }

    /// Forgets the window: the robot was moved, or the believed one has changed.
    pub(super) fn clear(&mut self) {
        self.window.clear();
        (self.next, self.best, self.evidence, self.suspect) = (0, None, 0.0, None);
    }

    /// Takes a sweep of the configured robot, and goes on with the search.
    pub(super) fn update(
        &mut self,
        sweep: &Sweep,
        believed: &RobotModel,
        is_trusted: impl Fn(usize) -> bool,
    ) -> Verdict {
        let (_, dtheta_rad) = motion(sweep, self.base_m);
        self.fitting_rad += dtheta_rad.abs();
        let has_moved = self.window.add(sweep, &self.configured, self.base_m, is_trusted, &self.params);
        if !has_moved {
            return Verdict::Open;
        }
        let Params { first_keys, min_returns, strong_log_ratio, confirm_every_sweeps, .. } = self.params;
        let is_strong = self.suspect.is_some_and(|(_, log_ratio)| log_ratio > strong_log_ratio);
        let share = if is_strong { 2 } else { 1 };
        if self.window.len() < first_keys / share || self.window.returns() < min_returns / share {
            return Verdict::Open;
        }
        match self.suspect {
            None => self.search(believed),
            Some((suspect, log_ratio)) => {
                self.confirming_keys += 1;
                if self.confirming_keys.is_multiple_of(confirm_every_sweeps) {
                    self.confirm(believed, suspect, log_ratio)
                } else {
                    Verdict::Open
                }
            }
        }
    }

    /// Tries the next alternatives; at the end of a round, weighs the best.
    fn search(&mut self, believed: &RobotModel) -> Verdict {
        (self.fitting_keys, self.round_keys) = (self.fitting_keys + 1, self.round_keys + 1);
        let is_quiet = self.is_known() && self.evidence <= 0.0;
        if is_quiet && !self.fitting_keys.is_multiple_of(self.params.known_every_sweeps) {
            return Verdict::Open;
        }
        let steps = if is_quiet {
            self.params.steps_known
        } else if self.evidence <= 0.0 && self.fitting_keys > self.params.new_keys {
            self.params.steps_fitting
        } else {
            self.params.steps_new
        };
        let reference = self.best_heading(believed, believed);
        for _ in 0..steps {
            let Some(alternative) = alternative(believed, self.next) else { return self.weigh(believed) };
            self.next += 1;
            let log_ratio = self.log_score(&alternative, believed) - reference;
            if self.best.is_none_or(|(best, _)| log_ratio > best) {
                self.best = Some((log_ratio, alternative));
            }
        }
        Verdict::Open
    }

    /// The believed robot with its ring turned by as little as makes the walls of the window sharpest: the filter does not learn that.
    pub(super) fn with_refined_ring(&mut self, believed: &RobotModel) -> RobotModel {
        let start = (self.log_score(believed, believed), *believed);
        self.climb(start, believed, Cause::Ring.moves(), FINE_STEPS).1
    }

    /// True once the believed robot has fitted for some metres and turns.
    pub(super) fn is_known(&self) -> bool {
        self.known_share() >= 1.0
    }

    /// The part of those metres and turns for which it has fitted.
    pub(super) fn known_share(&self) -> f64 {
        let (keys, rad) = (self.params.known_keys as f64, self.params.known_turn_rad);
        (self.fitting_keys as f64 / keys).min(self.fitting_rad / rad).min(1.0)
    }

    /// Adds the evidence of a round.
    fn weigh(&mut self, believed: &RobotModel) -> Verdict {
        self.next = 0;
        let Some((coarse, best)) = self.best.take() else { return Verdict::Open };
        // Refining takes as long as the round; it makes nothing of an alternative that is worse than the believed robot.
        let (log_ratio, refined) = if coarse > 0.0 { self.refine(best, believed, ROUGH_STEPS) } else { (coarse, best) };
        let excess = log_ratio - libm::log(self.params.fits_ratio);
        let part = (self.round_keys as f64 / self.params.evidence_keys).min(1.0);
        self.round_keys = 0;
        self.evidence = self.evidence * libm::pow(self.params.decay, part) + part * excess.max(0.0);
        if self.evidence < MIN_EVIDENCE {
            self.evidence = 0.0;
            return Verdict::Fits;
        }
        let caution = if self.is_known() { self.params.known_caution } else { 1.0 };
        if self.evidence < caution * self.params.suspect_evidence || refined.distance(believed) < 1.0 {
            return Verdict::Open;
        }
        (self.suspect, self.confirming_keys) = (Some((refined, log_ratio)), 0);
        self.window.clear();
        Verdict::Suspected
    }

    /// Lays out returns that the suspect was not found with.
    fn confirm(&mut self, believed: &RobotModel, suspect: RobotModel, found_log_ratio: f64) -> Verdict {
        let (log_ratio, refined) = self.refine(suspect, believed, FINE_STEPS);
        let fits = libm::log(self.params.fits_ratio);
        let min_log_ratio = (self.params.confirm_share * found_log_ratio).max(fits);
        let (is_same, is_full) = (refined.distance(&suspect) < self.params.same_model, self.window.is_full());
        // A full window of other returns need not show as much as the ones that raised the suspicion.
        if is_same && log_ratio > if is_full { fits } else { min_log_ratio } {
            let must_decide = self.confirming_keys >= self.params.decide_keys;
            let Some(found) = self.simplest(refined, believed, must_decide) else { return Verdict::Open };
            self.clear();
            (self.fitting_keys, self.fitting_rad) = (0, 0.0);
            return Verdict::Found(found);
        }
        // On a straight way all turns look alike.
        let ratio = suspect.turn / believed.turn;
        let turns_differ = !(self.params.turn_ratio.recip()..=self.params.turn_ratio).contains(&ratio);
        let can_tell = !turns_differ || self.window.turned_rad() >= self.params.telling_turn_rad;
        let is_refuted = can_tell && (log_ratio <= 0.0 || refined.distance(believed) < 1.0 || !is_same);
        if !is_full || !is_refuted {
            return Verdict::Open;
        }
        (self.suspect, self.evidence) = (None, 0.0);
        Verdict::Fits
    }

    /// The robot with a single cause that explains the walls as well as `found`, or else the one with other wheels alone, or else
    /// `found`. None while the returns do not tell two causes apart, unless they `must_decide`: then the wheels' scale is wrong, as by a
    /// wrong radius or tick count.
    fn simplest(&mut self, found: RobotModel, believed: &RobotModel, must_decide: bool) -> Option<RobotModel> {
        let causes = Cause::ALL.map(|cause| self.best_of(cause, believed));
        let single = causes.iter().map(|(score, _)| *score).fold(f64::NEG_INFINITY, f64::max);
        let enough = self.log_score(&found, believed) - self.params.occam;
        if single < enough {
            // The wheels and the ranges have one scale in common.
            let travel = found.travel * believed.range / found.range;
            let wheels = RobotModel { travel, turn: found.turn, ..*believed };
            let start = (self.log_score(&wheels, believed), wheels);
            let (score, wheels) = self.climb(start, believed, 0..WHEEL_MOVES, FINE_STEPS);
            let found = RobotModel { travel, range: believed.range, ..found };
            let found = if score >= enough { wheels } else { found };
            return Some(found.with_known_unit().unwrap_or(found));
        }
        let least = single - libm::log(self.params.same_cause_ratio);
        let mut rivals = causes.into_iter().filter(|(score, _)| *score >= least).map(|(_, robot)| robot);
        let first = rivals.next()?;
        if rivals.next().is_none() {
            return Some(first);
        }
        let is_scale = causes[0].0 >= least;
        (must_decide && is_scale).then_some(first)
    }

    /// The best robot that differs from the believed one by a single cause, and the log of its score.
    fn best_of(&mut self, cause: Cause, believed: &RobotModel) -> (f64, RobotModel) {
        let mut best = (f64::NEG_INFINITY, *believed);
        for index in cause.indices() {
            let Some(robot) = alternative(believed, index).filter(|robot| robot.has_known_unit(believed)) else {
                continue;
            };
            let score = self.log_score(&robot, believed);
            if score > best.0 {
                best = (score, robot);
            }
        }
        self.climb(best, believed, cause.moves(), FINE_STEPS)
    }

    /// Climbs from a robot to the nearest one that makes the walls sharpest; the log of its ratio to the believed one.
    fn refine(&mut self, from: RobotModel, believed: &RobotModel, steps: &[f64]) -> (f64, RobotModel) {
        let start = (self.log_score(&from, believed), from);
        let (_, best) = self.climb(start, believed, 0..NEIGHBOURS, steps);
        (self.best_heading(&best, believed) - self.best_heading(believed, believed), best)
    }

    /// Climbs by the given kinds of moves; their steps become smaller.
    fn climb(
        &mut self,
        from: (f64, RobotModel),
        believed: &RobotModel,
        moves: Range<usize>,
        steps: &[f64],
    ) -> (f64, RobotModel) {
        let mut best = from;
        for &step in steps {
            for _ in 0..3 {
                let before = best.0;
                for neighbour in neighbours(&best.1, step).into_iter().take(moves.end).skip(moves.start) {
                    let score = self.log_score(&neighbour, believed);
                    if score > best.0 {
                        best = (score, neighbour);
                    }
                }
                if best.0 <= before {
                    break;
                }
            }
        }
        best
    }

    /// The log score of a robot whose walls lie on the directions that arcs vote for: between two of them they are less sharp.
    fn best_heading(&mut self, model: &RobotModel, believed: &RobotModel) -> f64 {
        let headings = (0..HEADINGS).map(|step| step as f64 * concentration::STEP_RAD / HEADINGS as f64);
        headings.map(|heading_rad| self.log_score_at(model, believed, heading_rad)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn log_score(&mut self, model: &RobotModel, believed: &RobotModel) -> f64 {
        self.log_score_at(model, believed, 0.0)
    }

    /// The log of the sharpness, less for a robot that is far from the believed one; −∞ for an impossible robot.
    fn log_score_at(&mut self, model: &RobotModel, believed: &RobotModel, heading_rad: f64) -> f64 {
        let apart = |a: f64, b: f64| libm::log((a / b).abs()).abs();
        let factor = apart(model.travel, 1.0).max(apart(model.turn, 1.0)).max(apart(model.range, 1.0));
        if factor > libm::log(self.params.max_factor) {
            return f64::NEG_INFINITY;
        }
        let change = apart(model.travel, believed.travel).max(apart(model.turn, believed.turn));
        let change = change.max(apart(model.range, believed.range));
        self.sharpness(model, heading_rad) - self.params.factor_penalty * change
    }

    /// How sharp the walls of the window are for a robot, nats.
    fn sharpness(&mut self, model: &RobotModel, heading_rad: f64) -> f64 {
        let Self { window, concentration, sensors, configured, params, .. } = self;
        model.turn_ring(configured, sensors);
        concentration.clear();
        window.for_each_arc(model, sensors, heading_rad, |arc| concentration.add(arc, params));
        concentration.log_sharpness()
    }
}

/// One way in which a robot differs, as blocks of [`alternative`] and of [`neighbours`]. Where two explain the walls alike, the first
/// is believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    Scale,
    Turn,
    Range,
    Mirrored,
    Reversed,
    Ring,
}

impl Cause {
    const ALL: [Self; 6] = [Self::Scale, Self::Turn, Self::Range, Self::Mirrored, Self::Reversed, Self::Ring];

    const fn indices(self) -> Range<usize> {
        let scales = FACTORS.len();
        match self {
            Self::Scale => 0..scales,
            Self::Turn => scales..2 * scales,
            Self::Range => 2 * scales..3 * scales,
            Self::Mirrored => 3 * scales..3 * scales + 1,
            Self::Reversed => 3 * scales + 1..3 * scales + 2,
            Self::Ring => 3 * scales + 2..3 * scales + 1 + ROTATIONS,
        }
    }

    const fn moves(self) -> Range<usize> {
        match self {
            Self::Scale => 0..2,
            Self::Turn => 2..4,
            Self::Ring => 6..8,
            Self::Range | Self::Mirrored | Self::Reversed => 0..0,
        }
    }
}

/// First headings that are tried within a step of the directions.
const HEADINGS: usize = 3;
/// Less evidence is none.
const MIN_EVIDENCE: f64 = 0.02;
/// Factors by which hobbyists are wrong: from a fourth (edges for pulses) to four, in steps that the refinement bridges.
const FACTORS: [f64; 16] = [0.25, 0.3, 0.35, 0.42, 0.5, 0.6, 0.71, 0.84, 1.19, 1.41, 1.68, 2.0, 2.38, 2.83, 3.36, 4.0];
/// Rotations of a ring in a full turn; none is not an alternative.
const ROTATIONS: usize = 24;

/// The alternatives to a robot, one after another: both scales of the wheels, turning alone, ranges, signs, rotations of the ring, and
/// those of a mirrored ring.
fn alternative(believed: &RobotModel, index: usize) -> Option<RobotModel> {
    let RobotModel { travel, turn, ring_rad, range } = *believed;
    let scales = FACTORS.len();
    let turned = |step: usize| wrap_angle(ring_rad + step as f64 * TAU / ROTATIONS as f64);
    Some(match index {
        _ if index < scales => RobotModel { travel: travel * FACTORS[index], turn: turn * FACTORS[index], ..*believed },
        _ if index < 2 * scales => RobotModel { turn: turn * FACTORS[index - scales], ..*believed },
        _ if index < 3 * scales => RobotModel { range: range * FACTORS[index - 2 * scales], ..*believed },
        _ => match index - 3 * scales {
            0 => RobotModel { turn: -turn, ..*believed },
            1 => RobotModel { travel: -travel, turn: -turn, ..*believed },
            step if step <= ROTATIONS => RobotModel { ring_rad: turned(step - 1), ..*believed },
            step if step < 2 * ROTATIONS => RobotModel { ring_rad: turned(step - ROTATIONS), turn: -turn, ..*believed },
            _ => return None,
        },
    })
}

/// Steps of a climb: to raise a suspicion, and to confirm it.
const FINE_STEPS: &[f64] = &[0.1, 0.05, 0.02];
const ROUGH_STEPS: &[f64] = &[0.1, 0.05];
/// Kinds of moves to a neighbour; the first ones change the wheels.
const NEIGHBOURS: usize = 8;
const WHEEL_MOVES: usize = 4;

/// Robots a little beside another one.
fn neighbours(model: &RobotModel, step: f64) -> [RobotModel; NEIGHBOURS] {
    let RobotModel { travel, turn, ring_rad, range } = *model;
    let [more, less] = [1.0 + step, 1.0 / (1.0 + step)];
    let scaled =
        |by_travel: f64, by_turn: f64| RobotModel { travel: travel * by_travel, turn: turn * by_turn, ..*model };
    let turned = |sign: f64| RobotModel { ring_rad: wrap_angle(ring_rad + sign * step * 0.2 * PI), ..*model };
    [
        scaled(more, more),
        scaled(less, less),
        scaled(1.0, more),
        scaled(1.0, less),
        RobotModel { range: range * more, ..*model },
        RobotModel { range: range * less, ..*model },
        turned(1.0),
        turned(-1.0),
    ]
}
