//! The constants of all stages of the default method.

use crate::{align, fault, localize, mapping, orientation, position, robot_model, wall_slam};

/// The constants of all stages of the default method. [`Pipeline::with_params`](crate::Pipeline::with_params) runs with other ones.
///
/// | stage | constants | what they decide |
/// |---|---|---|
/// | `align` | [`AlignParams`](align::params::Params) | board time to host time, and pings to sweeps |
/// | `fault` | [`FaultParams`](fault::params::Params) | when a sensor or an encoder is faulty |
/// | `orientation` | [`OrientationParams`](orientation::params::Params) | the dominant directions of the walls, and the first heading |
/// | `position` | [`PositionParams`](position::params::Params) | EKF-SLAM: data association, landmarks, relocalization |
/// | `mapping` | [`MappingParams`](mapping::params::Params) | the occupancy grid and the inverse sensor model |
/// | `wall_slam` | [`WallSlamParams`](wall_slam::params::Params) | how the default method joins the four stages above, and its modes |
/// | `place` | [`PlaceParams`](wall_slam::place::params::Params) | when the robot is elsewhere, and where it is found again |
/// | `robot_model` | [`RobotModelParams`](robot_model::params::Params) | when the robot is not what its configuration says |
/// | `localize` | [`LocalizeParams`](localize::params::Params) | the search for the robot in a known map |
///
/// Each of them has a table: value, unit, how the value was chosen, and what breaks when it is wrong. Values are not checked: a run with
/// nonsense maps nonsense.
///
/// A varied value never changes the format of saved state: a [`SavedState`](crate::SavedState) holds measured quantities, not constants.
/// What a run saved with the defaults can be resumed with any values; log-odds and recurrences beyond the new bounds are clamped to them. The
/// other way round a restore refuses what lies beyond the defaults' bounds.
///
/// ```
/// use slamd_core::{Config, Pipeline, Start, built_in, stages::Params};
///
/// let mut params = Params::default();
/// params.position.slam.gate_sigma = 2.5;
/// let pipeline = Pipeline::with_params(&Config::default(), Start::Fresh, built_in, params)?;
/// # Ok::<(), slamd_core::InvalidState>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Params {
    /// Alignment.
    pub align: align::params::Params,
    /// Fault tests of sensors and encoders.
    pub fault: fault::params::Params,
    /// Dominant directions and first heading.
    pub orientation: orientation::params::Params,
    /// EKF-SLAM.
    pub position: position::params::Params,
    /// Occupancy grid and inverse sensor model.
    pub mapping: mapping::params::Params,
    /// The default method.
    pub wall_slam: wall_slam::params::Params,
    /// Check of the pose against the map, and search for a lost robot.
    pub place: wall_slam::place::params::Params,
    /// Check of the robot against the walls.
    pub robot_model: robot_model::params::Params,
    /// Localization in a known map.
    pub localize: localize::params::Params,
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    /// The names in the tables of a source, and those of its structs' fields.
    fn names(source: &str) -> [BTreeSet<&str>; 2] {
        let rows = source.lines().filter_map(|line| line.strip_prefix("/// | `")?.split('`').next());
        let fields = source.lines().filter_map(|line| line.strip_prefix("    pub ")?.split_once(": ").map(|it| it.0));
        [rows.collect(), fields.filter(|name| !name.contains(['(', ' '])).collect()]
    }

    #[test]
    fn each_constant_has_its_row_and_each_row_its_constant() {
        for (stage, source) in [
            ("align", include_str!("align/params.rs")),
            ("fault", include_str!("fault/params.rs")),
            ("mapping", include_str!("mapping/params.rs")),
            ("wall_slam", include_str!("wall_slam/params.rs")),
            ("place", include_str!("wall_slam/place/params.rs")),
            ("robot_model", include_str!("robot_model/params.rs")),
            ("localize", include_str!("localize/params.rs")),
        ] {
            let [rows, fields] = names(source);
            assert!(rows.len() > 5, "{stage}: {rows:?}");
            assert_eq!(rows, fields, "{stage}");
        }
        let [rows, fields] = names("/// | `a_m` | 1 |\n    pub b_m: f64,\n");
        assert_ne!(rows, fields);
    }
}
