//! The constants of the orientation stage.

use crate::geometry::degrees;

/// All constants of the orientation stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Params {
    /// The Hough transform.
    pub directions: DirectionsParams,
    /// The search of axis and wheels at the start.
    pub start: StartParams,
}

/// Constants of `dominant_directions`. A direction is one degree.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `min_contrast` | 1.25 | - | by hand | too small: an axis is found where there is none; too large: a sparse ring never starts |
/// | `rho_step_m` | 0.03 | m | by hand: 1.5 times the noise of a range | too small: one wall's votes spread; too large: every direction gathers them |
/// | `max_oblique_rad` | 30.0 | deg | by hand: farther off its normal a wall is a mirror for sonar. The series of the cosine loses digits beyond | too small: fewer votes; too large: echoes of other walls vote |
/// | `near_directions` | 8 | directions | by hand: wheels within their prior turn the axis by less | too small: the true axis is missed; too large: time |
/// | `peak_directions` | 6 | directions | by hand | too small: noise moves the vertex; too large: other peaks do |
/// | `own_directions` | 15 | directions | by hand: half of the 30 degrees at which the simulator's furniture stands | too small: the peak's own flank is its rival; too large: furniture is none |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionsParams {
    pub min_contrast: f64,
    pub rho_step_m: f64,
    pub max_oblique_rad: f64,
    pub near_directions: usize,
    pub peak_directions: usize,
    pub own_directions: usize,
}

impl Default for DirectionsParams {
    fn default() -> Self {
        Self {
            min_contrast: 1.25,
            rho_step_m: 0.03,
            max_oblique_rad: degrees(30.0),
            near_directions: 8,
            peak_directions: 6,
            own_directions: 15,
        }
    }
}

/// Constants of `start`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `prior` | 0.02 | log strength | by hand | too small: chance moves the wheels; too large: wheels stay as configured and bend the first map |
/// | `rounds` | [1.5, 1.0, 0.5, 0.25] | sigma | by hand: far first, then between | too far: wrong wheels fit by chance; too near: bad wheels are out of reach |
/// | `max_returns` | 1_600 | returns | by hand: bounds the time of a sweep; more returns made wheels three times as bad no better (docs/accuracy.md) | too small: a coarse axis; too large: a sweep takes too long |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartParams {
    pub prior: f64,
    pub rounds: [f64; 4],
    pub max_returns: usize,
}

impl Default for StartParams {
    fn default() -> Self {
        Self { prior: 0.02, rounds: [1.5, 1.0, 0.5, 0.25], max_returns: 1_600 }
    }
}

#[cfg(test)]
mod tests {
    use crate::position::params::table_errors;

    #[test]
    fn each_table_tells_the_defaults() {
        assert_eq!(table_errors(include_str!("params.rs")), Vec::<String>::new());
    }
}
