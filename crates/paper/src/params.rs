//! The constants of the paper's method.

/// The constants of the paper's method. Sizes of accumulators and tiles stay constants of their files.
///
/// "By hand" means: set by hand in the first version, the paper gives no value, not measured alone since; `slamd bench paper` measures
/// all of them together (`docs/paper.md`). What follows a "by hand;" explains the value, it did not measure it.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `ignored_sweeps` | 30 | sweeps | by hand; three seconds at 10 sweeps per second | smaller: a faulty sensor returns between verdicts |
/// | `first_verdict_sweeps` | 9 | sweeps | three blocks of three instants | smaller: the chain (λ) has not settled |
/// | `chain` | 0.5 | | λ, the previous block's share | larger: latency; smaller: false alarms |
/// | `mspe_limit_m2` | 1e−4 | m² | simulated sweeps with 2 cm of range noise: healthy MSPE is about 0.6e−4 | smaller: every block has an anomaly; larger: faults are missed |
/// | `residual_limit_m2` | 2.5e−3 | m² | as above: healthy q is about 0.7e−4, 20 cm of noise have 70e−4 | smaller: healthy sensors are ignored |
/// | `same_m` | 1e−3 | m | by hand | larger: a slow drive looks stuck |
/// | `moved` | 0.1 | m or rad | by hand; a robot that moved less may read the same twice | smaller: a standing robot has stuck sensors |
/// | `longest_step_s` | 1 | s | by hand; bounds the local map | larger: time per sweep after a gap |
/// | `sweep_line_votes` | 4 | endpoints | by hand | smaller: clutter turns the heading; larger: the heading is seldom corrected |
/// | `map_line_votes` | 30 | cells | by hand; 30 cm of wall | smaller: clutter becomes lines |
/// | `map_lines` | 8 | lines | by hand; two rooms have as many walls | smaller: the right wall is missing; larger: time |
/// | `line_sigma_rad` | 0.026 | rad | by hand; 1.5° | stated heading variance only |
/// | `band_m` | 0.08 | m | by hand; more than one column of 5 cm | smaller: lines miss noisy voters; larger: parallel lines merge |
/// | `refinements` | 3 | | by hand | smaller: lines keep the error of a cell of the accumulator |
/// | `min_endpoints` | 3 | endpoints | by hand | smaller: single outliers move the pose |
/// | `near_m` | 0.2 | m | by hand | smaller: drift over it is not corrected; larger: clutter moves the pose |
/// | `endpoint_sigma_m` | 0.03 | m | by hand; 2 cm of range noise and the heading's error | smaller: a covariance that is too small |
/// | `line_sigma_m` | 0.01 | m | by hand; one cell | as above |
/// | `gate` | 3.5 | sigma | by hand; the design names 3.5 sigma for the default method, too | smaller: drift is not corrected; larger: outliers move the pose |
/// | `q_per_m` | 3e−4 | m² per m | by hand; 1.7 cm after a metre | smaller: the encoders outweigh the walls |
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the table above says it")]
pub struct Params {
    pub ignored_sweeps: u64,
    pub first_verdict_sweeps: u64,
    pub chain: f64,
    pub mspe_limit_m2: f64,
    pub residual_limit_m2: f64,
    pub same_m: f64,
    pub moved: f64,
    pub longest_step_s: f64,
    pub sweep_line_votes: usize,
    pub map_line_votes: usize,
    pub map_lines: usize,
    pub line_sigma_rad: f64,
    pub band_m: f64,
    pub refinements: usize,
    pub min_endpoints: usize,
    pub near_m: f64,
    pub endpoint_sigma_m: f64,
    pub line_sigma_m: f64,
    pub gate: f64,
    pub q_per_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            ignored_sweeps: 30,
            first_verdict_sweeps: 9,
            chain: 0.5,
            mspe_limit_m2: 1e-4,
            residual_limit_m2: 2.5e-3,
            same_m: 1e-3,
            moved: 0.1,
            longest_step_s: 1.0,
            sweep_line_votes: 4,
            map_line_votes: 30,
            map_lines: 8,
            line_sigma_rad: 0.026,
            band_m: 0.08,
            refinements: 3,
            min_endpoints: 3,
            near_m: 0.2,
            endpoint_sigma_m: 0.03,
            line_sigma_m: 0.01,
            gate: 3.5,
            q_per_m: 3e-4,
        }
    }
}

impl Params {
    /// Sweeps whose pose is the encoders': until the first verdict, and as many again for the first map.
    #[must_use]
    pub fn first_map_sweeps(&self) -> u64 {
        2 * self.first_verdict_sweeps
    }
}
