//! The constants of the orientation stage.

use crate::geometry::degrees;

/// All constants of the orientation stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Params {
    /// The Hough transform.
    pub directions: DirectionsParams,
    /// The search of axis and wheels at the start.
    pub start: StartParams,
    /// The axis along the way.
    pub track: TrackParams,
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

/// Constants of `axis_tracker`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `window_m` | 1.5 | m | the recordings of docs/real-data.md | too small: furniture is an axis; too large: the wheels bend the window |
/// | `min_window` | 0.5 | windows | by hand | too small: the first returns are too few; too large: the heading waits |
/// | `read_m` | 0.15 | m | by design: ten readings a window | too small: time is wasted; too large: the heading is corrected late |
/// | `step_m` | 0.03 | m | by design: 50 sweeps a window | too small: time is wasted; too large: few returns |
/// | `rim_m` | 0.15 | m | by design: radius of a usual ring; what a turn by one radian counts as | too small: turning on the spot fills the window slowly; too large: the window holds little travel |
/// | `sensors` | 8 | sensors | by design: the smallest ring with a heading of its own | as `step_m` |
/// | `max_returns` | 400 | returns | by design: `sensors` times the sweeps of a window | too small: a short window; too large: time |
/// | `min_returns` | 30 | returns | by hand | too small: chance has an axis; too large: a sparse ring has none |
/// | `bin_m` | 0.08 | m | the recordings of docs/real-data.md | too small: noise spreads a wall; too large: every turn gathers it |
/// | `turn_rad` | 1.0 | deg | by design: the vertex of a parabola is between | too small: time; too large: peaks are missed |
/// | `near_steps` | 20 | steps | by hand: more than the wheels miss in a window | too small: a slip is not found; too large: time |
/// | `near_rad` | 6.0 | deg | the recordings of docs/real-data.md | too small: a slip is not followed; too large: curved and slanted walls turn the heading |
/// | `sigma_rad` | 0.7 | deg | the recordings of docs/real-data.md | too small: furniture turns the map; too large: the wheels do |
/// | `half_preference` | 0.3 | - | by hand | too small: a building without right angles has an axis; too large: furniture hides it |
/// | `min_preference` | 0.01 | - | by hand | as `half_preference` |
/// | `min_whole_preference` | 1.0 | - | by hand | too small: furniture contradicts the heading; too large: a wrong heading is silent |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackParams {
    pub window_m: f64,
    pub min_window: f64,
    pub read_m: f64,
    pub step_m: f64,
    pub rim_m: f64,
    pub sensors: usize,
    pub max_returns: usize,
    pub min_returns: usize,
    pub bin_m: f64,
    pub turn_rad: f64,
    pub near_steps: usize,
    pub near_rad: f64,
    pub sigma_rad: f64,
    pub half_preference: f64,
    pub min_preference: f64,
    pub min_whole_preference: f64,
}

impl Default for TrackParams {
    fn default() -> Self {
        Self {
            window_m: 1.5,
            min_window: 0.5,
            read_m: 0.15,
            step_m: 0.03,
            rim_m: 0.15,
            sensors: 8,
            max_returns: 400,
            min_returns: 30,
            bin_m: 0.08,
            turn_rad: degrees(1.0),
            near_steps: 20,
            near_rad: degrees(6.0),
            sigma_rad: degrees(0.7),
            half_preference: 0.3,
            min_preference: 0.01,
            min_whole_preference: 1.0,
        }
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
