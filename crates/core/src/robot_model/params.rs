//! The constants of the check of the robot against the walls.

use crate::geometry::degrees;

/// Constants of `robot_model`.
///
/// "Homes 1-60" are drives through random homes (`cargo xtask never-silent`).
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `max_keys` | 96 | sweeps | by design: 2.4 m at 0.25 m/s and 10 Hz | Too small: two hypotheses look alike. Too large: drift blurs the walls of the right one |
/// | `min_keys` | 16 | sweeps | by design: less than a metre at 2 Hz | Too small: chance decides. Too large: a wrong robot is named late |
/// | `first_keys` | 20 | sweeps | as `min_keys` | As `min_keys` |
/// | `min_returns` | 60 | returns | by design: three in each of the first sweeps | Too small: a single wall decides. Too large: sparse rings are never checked |
/// | `returns_per_key` | 4 | returns | board.py: 6 and 16 tell the same robots apart | Too small: chance decides. Too large: time is wasted |
/// | `min_step_m` | 0.01 | m | by design: below half of a sweep's travel at walking pace | Too small: a standing robot fills the window. Too large: four times too few ticks fill it slowly |
/// | `rim_m` | 0.15 | m | by design: radius of a usual ring | Too small: turning fills the window slowly. Too large: the window holds little travel |
/// | `max_path_m` | 8.0 | m | by design: wheels drift by 2 % | Too small: little is seen at low rates. Too large: drift blurs walls |
/// | `max_incidence_rad` | 35 | degrees | by design: as far outside the cone as a wall's normal may lie | Too small: what oblique beams return finds no wall. Too large: time is wasted |
/// | `edge_vote` | 0.5 | 1 | board.py and homes 1-60: smooth walls are heard by the cone, rough ones by its edge too | Too small: oblique returns find no wall. Too large: chance lines are as sharp as walls |
/// | `rho_step_m` | 0.05 | m | by design: twice the noise of a reading | Too small: noise spreads votes. Too large: scales look alike |
/// | `strong_log_ratio` | 0.9 | nat | by design: walls nearly twice as sharp need half the returns | As `first_keys` |
/// | `steps_new` | 15 | hypotheses per sweep | by design: a round takes five sweeps until the robot is known | Too small: a wrong robot is named late. Too large: time is wasted |
/// | `new_keys` | 200 | sweeps | by design: the first 5 m | Too small: a wrong robot is named late. Too large: time is wasted |
/// | `steps_fitting` | 8 | hypotheses per sweep | by design: a round takes a second while nothing speaks against the robot | As `steps_new` |
/// | `steps_known` | 1 | hypotheses | by design | As `steps_new` |
/// | `known_every_sweeps` | 16 | sweeps | by design: a few per cent of a sweep's time | As `steps_new` |
/// | `known_keys` | 200 | sweeps | by design: some 5 m | Too small: the search becomes slow before a wrong robot shows. Too large: time is wasted |
/// | `unknown_scale_sigma` | 0.1 | - | by hand: robots whose scale is off by less are not found within 5 m | Too small: a pose is silently wrong until the robot is found. Too large: the first metres of a good robot look doubtful |
/// | `known_scale_sigma` | 0.01 | - | by hand: what the search leaves | As `unknown_scale_sigma`, for the rest of the drive |
/// | `known_turn_rad` | 6.28 | rad | by design: one turn | As `known_keys` |
/// | `turn_ratio` | 1.05 | 1 | by design: a suspect that differs by less is no matter of turning | Too small: a straight way answers nothing. Too large: a straight way refutes a wrong turning |
/// | `telling_turn_rad` | 1.0 | rad | by design: two thirds of a right angle | As `turn_ratio` |
/// | `fits_ratio` | 1.15 | 1 | homes 1-60: nineteen of twenty windows of a right robot lie below | Too small: false alarms. Too large: small differences are not seen |
/// | `suspect_evidence` | 0.3 | nat | as `fits_ratio` | Too small: doubts without a cause. Too large: a wrong robot is silent for longer |
/// | `evidence_keys` | 10 | sweeps | by design: a tenth of the window is new | Too small: one chance counts many times. Too large: a wrong robot is named late |
/// | `decay` | 0.9 | 1 per `evidence_keys` | as `fits_ratio` | Too small: weak evidence never adds up. Too large: old evidence lasts |
/// | `confirm_every_sweeps` | 3 | sweeps | by design: a confirmation takes as long as a round of the search | Too small: time is wasted. Too large: a wrong robot is named late |
/// | `decide_keys` | 200 | sweeps | by design: some 5 m without a turn | Too small: the wheels' scale is blamed for the ranges' unit. Too large: a robot that never turns is never named |
/// | `confirm_share` | 0.5 | 1 | homes 1-60: of the log ratio that raised the suspicion | Too small: false alarms. Too large: small differences are never named |
/// | `same_cause_ratio` | 1.15 | 1 | by design: below, turning has not told two causes apart | Too small: the wrong key is named. Too large: naming waits for a turn |
/// | `same_model` | 2.5 | 1 | by design: half a factor | Too small: a confirmation that differs a little is refused |
/// | `occam` | 0.2 | nat | by design: what chance adds to the sharpness | Too small: one cause is named as two. Too large: two are named as one |
/// | `max_factor` | 5.0 | 1 | by design: edges for pulses is a factor of 4 | Too small: a wrong robot is not found. Too large: an empty corridor, which shows no travel, proves any |
/// | `factor_penalty` | 0.1 | nat per e-fold | by design: a compressed layout is a little sharper by itself | Too small: an empty corridor stops the robot. Too large: wrong scales are found late |
/// | `known_caution` | 1.2 | 1 | by design: a robot that fitted for metres does not change | Too small: slip becomes a lasting doubt. Too large: a late change is never named |
/// | `learnt_distance` | 0.8 | 1 | by design: a base that is off by a sixth | Too small: a good map is begun anew for little. Too large: the map keeps what was drawn before the base was learnt |
/// | `found_sigma` | 0.08 | 1 | by design: the resolution of the search | Too small: the filter keeps its error. Too large: the first false wall stretches the map |
/// | `restart_passes` | 3 | passes | by design: the second begins where the first ended, the third confirms | Too small: walls keep the error of the search. Too large: the pipeline stands still for longer |
/// | `restart_distance` | 0.05 | 1 | by design: 1 % of travel or turning | As `restart_passes` |
/// | `unit_range_m` | 0.48 | m | as `decade_near_us` of the alignment | As `unit_path_m` |
/// | `unit_path_m` | 3.0 | m | the alignment names a wrong unit within 2 m | Too small: ranges in a wrong unit are called a wrong robot. Too large: a robot in a narrow place is checked late |
/// | `max_history_sweeps` | 1800 | sweeps | by design: three minutes at 10 Hz, some 6 MB with 32 sensors | Too small: a wrong robot is named but not corrected. Too large: memory, and the time of a restart |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub max_keys: usize,
    pub min_keys: usize,
    pub first_keys: usize,
    pub min_returns: usize,
    pub returns_per_key: usize,
    pub min_step_m: f64,
    pub rim_m: f64,
    pub max_path_m: f64,
    pub max_incidence_rad: f64,
    pub edge_vote: f32,
    pub rho_step_m: f64,
    pub strong_log_ratio: f64,
    pub steps_new: usize,
    pub new_keys: u64,
    pub steps_fitting: usize,
    pub steps_known: usize,
    pub known_every_sweeps: u64,
    pub known_keys: u64,
    pub unknown_scale_sigma: f64,
    pub known_scale_sigma: f64,
    pub known_turn_rad: f64,
    pub turn_ratio: f64,
    pub telling_turn_rad: f64,
    pub fits_ratio: f64,
    pub suspect_evidence: f64,
    pub evidence_keys: f64,
    pub decay: f64,
    pub confirm_every_sweeps: u64,
    pub decide_keys: u64,
    pub confirm_share: f64,
    pub same_cause_ratio: f64,
    pub same_model: f64,
    pub occam: f64,
    pub max_factor: f64,
    pub factor_penalty: f64,
    pub known_caution: f64,
    pub learnt_distance: f64,
    pub found_sigma: f64,
    pub restart_passes: usize,
    pub restart_distance: f64,
    pub unit_range_m: f64,
    pub unit_path_m: f64,
    pub max_history_sweeps: usize,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            max_keys: 96,
            min_keys: 16,
            first_keys: 20,
            min_returns: 60,
            returns_per_key: 4,
            min_step_m: 0.01,
            rim_m: 0.15,
            max_path_m: 8.0,
            max_incidence_rad: degrees(35.0),
            edge_vote: 0.5,
            rho_step_m: 0.05,
            strong_log_ratio: 0.9,
            steps_new: 15,
            new_keys: 200,
            steps_fitting: 8,
            steps_known: 1,
            known_every_sweeps: 16,
            known_keys: 200,
            unknown_scale_sigma: 0.1,
            known_scale_sigma: 0.01,
            known_turn_rad: std::f64::consts::TAU,
            turn_ratio: 1.05,
            telling_turn_rad: 1.0,
            fits_ratio: 1.15,
            suspect_evidence: 0.3,
            evidence_keys: 10.0,
            decay: 0.9,
            confirm_every_sweeps: 3,
            decide_keys: 200,
            confirm_share: 0.5,
            same_cause_ratio: 1.15,
            same_model: 2.5,
            occam: 0.2,
            max_factor: 5.0,
            factor_penalty: 0.1,
            known_caution: 1.2,
            learnt_distance: 0.8,
            found_sigma: 0.08,
            restart_passes: 3,
            restart_distance: 0.05,
            unit_range_m: 0.48,
            unit_path_m: 3.0,
            max_history_sweeps: 1_800,
        }
    }
}
