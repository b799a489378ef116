//! The constants of the position stage, one struct per component.
//!
//! Each table names a constant, its value and unit, how it was chosen and what breaks when it is wrong. "Seeds 1-20" and the
//! like are drives of `slamd bench accuracy` (docs/accuracy.md); "by hand" is a value that came
//! with its component and has not been measured alone since. A test keeps the tables and the defaults alike.

use crate::geometry::degrees;

/// All constants of the position stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Params {
    /// A return against a wall.
    pub beam: BeamParams,
    /// The extended Kalman filter.
    pub filter: FilterParams,
    /// Data association, heading and merging of walls.
    pub slam: SlamParams,
    /// New walls.
    pub initializer: InitializerParams,
    /// Walls out of the filter.
    pub inactive: InactiveParams,
    /// Agreement of readings and map.
    pub monitor: MonitorParams,
    /// Whiteness of heading innovations.
    pub whiteness: WhitenessParams,
    /// The noise of a reading.
    pub noise: NoiseParams,
    /// Agreement of walls and wheels.
    pub agreement: AgreementParams,
    /// Global search of a lost robot.
    pub relocalize: RelocalizeParams,
}

/// Constants of `beam_model`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `range_sigma_m` | 0.02 | m | by hand: the noise of the simulator's sensors | too small: NIS above 1, true returns fail the gate; too large: the pose follows the wheels |
/// | `edge_sigma_rad` | 1.5 | deg | seeds 1-20, with the heading from misfits; 2.5 before | too small: oblique returns bend walls; too large: the heading loses its best source |
/// | `point_sigma_rad` | 0.5 | deg | seeds 1-10 | as above, for point beams |
/// | `max_incidence_rad` | 42.0 | deg | prototype: a wall returns up to 35 to 40 degrees off its normal | too small: fewer beams per wall; above 45 degrees another side is nearer |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamParams {
    pub range_sigma_m: f64,
    pub edge_sigma_rad: f64,
    pub point_sigma_rad: f64,
    pub max_incidence_rad: f64,
}

impl Default for BeamParams {
    fn default() -> Self {
        Self {
            range_sigma_m: 0.02,
            edge_sigma_rad: degrees(1.5),
            point_sigma_rad: degrees(0.5),
            max_incidence_rad: degrees(42.0),
        }
    }
}

/// Constants of `filter`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `travel_sigma` | 0.01 | 1 | by hand: a radius of 35 mm to 0.3 mm; with 0.03 the median error of 8 sensors in homes 1-6 grows from 0.15 to 0.25 m | too small: a wheel of another size bends the map; too large: the first false wall stretches it |
/// | `start_sigma_m` | 1e-4 | m | the start defines the origin; not zero so that P stays positive | larger: the whole map may shift against its origin |
/// | `wheel_noise_m` | 3.5e-5 | m (variance, m², per m) | seeds 1-10; 2.5e-4 before | too small: the filter trusts slipping wheels, NEES grows; too large: single wrong walls move the pose |
/// | `max_slip` | 10.0 | - | by hand; wheels three times as bad have nine times the variance | too small: such wheels stay overtrusted; too large: a wrong wall looks like slip |
/// | `slip_gain` | 0.01 | - | by hand: about a hundred sweeps of memory | too small: slip is found too late; too large: single outliers count as slip |
/// | `max_nis` | 9.0 | sigma² | by hand: 3 sigma | too large: single outliers count as slip |
/// | `wheel_drift_m` | 2e-8 | 1/m (variance per m) | by hand | too small: worn wheels or another carpet are never estimated; too large: the calibration wanders |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterParams {
    pub travel_sigma: f64,
    pub start_sigma_m: f64,
    pub wheel_noise_m: f64,
    pub max_slip: f64,
    pub slip_gain: f64,
    pub max_nis: f64,
    pub wheel_drift_m: f64,
}

impl Default for FilterParams {
    fn default() -> Self {
        Self {
            travel_sigma: 0.01,
            start_sigma_m: 1e-4,
            wheel_noise_m: 3.5e-5,
            max_slip: 10.0,
            slip_gain: 0.01,
            max_nis: 9.0,
            wheel_drift_m: 2e-8,
        }
    }
}

/// Constants of `ekf_slam`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `gate_sigma` | 2.2 | sigma | seeds 1-20, with returns up to 30 degrees outside a cone; 3.5, then 2.8 before | too small: walls are not recognized and double; too large: furniture counts as the wall behind it |
/// | `max_oblique_rad` | 30.0 | deg | seeds 1-20, with the heading from misfits; 4 before | too small: too few beams tell the heading; too large: mirrored echoes enter |
/// | `model_sigma_m` | 0.008 | m | prototype: 6 to 12 mm are good; 15 and 30 mm on seeds 1-20 lost more drives in the furnished room | too small: the filter grows overconfident; too large: the pose drifts |
/// | `frozen_sigma_m` | 0.025 | m | by hand, with the first localization in a saved map | too small: errors of the saved map move the pose by jumps |
/// | `heading_sigma_rad` | 0.3 | deg | by hand, with the heading from misfits | too small: overconfident heading; too large: wheels bend the map |
/// | `heading_gate_sigma` | 4.0 | sigma | by hand, with the heading from misfits | too small: a heading that is off is never corrected; too large: wrong walls turn the robot |
/// | `axis_gate_sigma` | 2.0 | sigma | the recordings of docs/real-data.md | too small: furniture at an angle makes the heading doubtful; too large: the filter stays surer of wrong walls than of the building's axis |
/// | `min_heading_information` | 1.0 | 1/rad² | by hand: a heading known to no more than a radian is no measurement | too large: sparse rings measure no heading |
/// | `few_beams` | 3 | beams | by hand: with half a ring, headings from so few beams turned the robot by tens of degrees | too small: sparse rings turn with one wrong wall; too large: bad wheels are trusted instead |
/// | `edge_sweeps` | 10.0 | sweeps | seeds 1-20 with wheels three times as bad: 5, 20, 40 and 100 lost more drives in the furnished room | too small: repeated edge errors count as independent, NEES 196 at 1 |
/// | `margin_m` | 0.15 | m | seeds 1-10; 0.35 before | too small: walls do not grow; too large: a wall explains returns beyond its end |
/// | `max_extension_rad` | 0.1 | rad | by hand: only a return from within the cone or near it tells where along the wall it came from | too large: walls grow past their ends |
/// | `well_known_hits` | 15 | sweeps | by hand | too small: passing furniture contradicts the map; too large: a lost robot notices late |
/// | `expect_cone_share` | 0.7 | - | by hand | too large: ranges are predicted where the cone's edge may miss |
/// | `min_expect_rad` | 0.1 | rad | by hand, for point beams | too small: point beams hardly ever test the map |
/// | `expect_inset_m` | 0.1 | m | by hand | too small: the ends of walls contradict the map |
/// | `unlearnt_readings` | 8 | readings | by hand: half a sweep of a ring of 16 | too small: a wall behind a passing person is unlearnt; too large: a wall that is not there declares a found robot lost again |
/// | `min_expected_m` | 0.05 | m | by hand | a robot that touches a wall predicts ranges that no sensor measures |
/// | `same_wall_m` | 0.07 | m | by hand | too small: walls double; too large: a door and its frame merge |
/// | `same_gap_m` | 0.6 | m | by hand | too small: a wall stays in pieces; too large: rooms that nearly align are made to |
/// | `same_gate` | 9.0 | sigma² | by hand: 3 sigma | too small: walls double; too large: two walls merge that the filter tells apart |
/// | `relocalized_sigma_m` | 0.05 | m | by hand: the search's bin | too small: the first walls fail the gate; too large: they match the wrong wall |
/// | `relocalized_sigma_rad` | 2.0 | deg | by hand | as above |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlamParams {
    pub gate_sigma: f64,
    pub max_oblique_rad: f64,
    pub model_sigma_m: f64,
    pub frozen_sigma_m: f64,
    pub heading_sigma_rad: f64,
    pub heading_gate_sigma: f64,
    pub axis_gate_sigma: f64,
    pub min_heading_information: f64,
    pub few_beams: usize,
    pub edge_sweeps: f64,
    pub margin_m: f64,
    pub max_extension_rad: f64,
    pub well_known_hits: u32,
    pub unlearnt_readings: i32,
    pub expect_cone_share: f64,
    pub min_expect_rad: f64,
    pub expect_inset_m: f64,
    pub min_expected_m: f64,
    pub same_wall_m: f64,
    pub same_gap_m: f64,
    pub same_gate: f64,
    pub relocalized_sigma_m: f64,
    pub relocalized_sigma_rad: f64,
}

impl Default for SlamParams {
    fn default() -> Self {
        Self {
            gate_sigma: 2.2,
            max_oblique_rad: degrees(30.0),
            model_sigma_m: 0.008,
            frozen_sigma_m: 0.025,
            heading_sigma_rad: degrees(0.3),
            heading_gate_sigma: 4.0,
            axis_gate_sigma: 2.0,
            min_heading_information: 1.0,
            few_beams: 3,
            edge_sweeps: 10.0,
            margin_m: 0.15,
            max_extension_rad: 0.1,
            well_known_hits: 15,
            unlearnt_readings: 8,
            expect_cone_share: 0.7,
            min_expect_rad: 0.1,
            expect_inset_m: 0.1,
            min_expected_m: 0.05,
            same_wall_m: 0.07,
            same_gap_m: 0.6,
            same_gate: 9.0,
            relocalized_sigma_m: 0.05,
            relocalized_sigma_rad: degrees(2.0),
        }
    }
}

impl SlamParams {
    /// Variance of the difference of one wall's two offsets, m²: each has the noise of the model.
    #[must_use]
    pub fn same_noise_m2(&self) -> f64 {
        2.0 * self.model_sigma_m * self.model_sigma_m
    }
}

/// Constants of `landmark_initializer`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `near_m` | 0.06 | m | by hand: three times the noise of a range | too small: noise splits candidates; too large: skirting and wardrobe become one |
/// | `reach_m` | 0.6 | m | by hand | too small: a sparse ring never finishes a wall; too large: separate things line up |
/// | `min_hits` | 6 | returns | seeds 1-10; 8 before | too small: clutter becomes walls; too large: walls come late |
/// | `min_sweeps` | 3 | sweeps | seeds 1-10; 5 before | as above |
/// | `min_extent_m` | 0.25 | m | by hand | too small: chair legs become walls; too large: short walls are missed |
/// | `min_travel_m` | 0.06 | m | by hand | too small: a robot at rest makes walls of corners |
/// | `max_scatter_m` | 0.028 | m | by hand; prototype: below 25 mm in a 5 cm accumulator | too small: noisy sensors make no wall; too large: slanted things become walls |
/// | `max_oblique_rad` | 16.0 | deg | by hand | too large: edge errors bend new walls |
/// | `max_idle_sweeps` | 60 | sweeps | by hand: six seconds at 10 Hz | too small: walls in passing are lost; too large: drifted poses mix |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitializerParams {
    pub near_m: f64,
    pub reach_m: f64,
    pub min_hits: u32,
    pub min_sweeps: u32,
    pub min_extent_m: f64,
    pub min_travel_m: f64,
    pub max_scatter_m: f64,
    pub max_oblique_rad: f64,
    pub max_idle_sweeps: u64,
}

impl Default for InitializerParams {
    fn default() -> Self {
        Self {
            near_m: 0.06,
            reach_m: 0.6,
            min_hits: 6,
            min_sweeps: 3,
            min_extent_m: 0.25,
            min_travel_m: 0.06,
            max_scatter_m: 0.028,
            max_oblique_rad: degrees(16.0),
            max_idle_sweeps: 60,
        }
    }
}

/// Constants of the walls out of the filter.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `deactivate_m` | 6.0 | m | by hand: twice the range of the sensors | too small: walls in use leave; too large: a full filter takes no new wall |
/// | `reactivate_m` | 4.5 | m | by hand: beyond the range, below `deactivate_m` | too small: known walls are initialized again; too large: walls go in and out |
/// | `lookahead_m` | 1.0 | m | by hand: all walls are searched once per so much travel, so that the cost does not grow with the building | too small: time per sweep grows with the map |
/// | `spare` | 12 | walls | by hand | too small: no slot for a new wall; too large: fewer walls in use |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InactiveParams {
    pub deactivate_m: f64,
    pub reactivate_m: f64,
    pub lookahead_m: f64,
    pub spare: usize,
}

impl Default for InactiveParams {
    fn default() -> Self {
        Self { deactivate_m: 6.0, reactivate_m: 4.5, lookahead_m: 1.0, spare: 12 }
    }
}

/// Constants of `localization_monitor`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `max_error_m` | 0.15 | m | by hand | too small: noise contradicts the map; too large: a shifted robot does not notice |
/// | `short_readings` | 25.0 | readings | by hand: less than one sweep of a ring of 32 | too small: one piece of furniture suspends the map; too large: a second map starts |
/// | `short_neutral` | 3.0 | readings | by hand | too small: the first few readings decide |
/// | `long_readings` | 90.0 | readings | by hand | too small: false alarms; too large: a lost robot notices late |
/// | `long_neutral` | 6.0 | readings | by hand | too small: the first few readings decide |
/// | `max_sure` | 0.12 | - | by hand | too small: the doubt never ends; too large: it ends at a wrong pose |
/// | `max_learning` | 0.25 | - | by hand | too small: furniture suspends the map; too large: a second map starts |
/// | `max_kept` | 0.45 | - | by hand | too small: false alarms; too large: a lost robot maps on |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonitorParams {
    pub max_error_m: f64,
    pub short_readings: f64,
    pub short_neutral: f64,
    pub long_readings: f64,
    pub long_neutral: f64,
    pub max_sure: f64,
    pub max_learning: f64,
    pub max_kept: f64,
}

impl Default for MonitorParams {
    fn default() -> Self {
        Self {
            max_error_m: 0.15,
            short_readings: 25.0,
            short_neutral: 3.0,
            long_readings: 90.0,
            long_neutral: 6.0,
            max_sure: 0.12,
            max_learning: 0.25,
            max_kept: 0.45,
        }
    }
}

/// Constants of the whiteness test of heading innovations.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `gain` | 0.1 | - | by hand: some twenty innovations of memory | too small: a repeated error is noticed late; too large: chance looks like one |
/// | `white_sigma` | 2.0 | sigma | by hand: 95 % of white means lie within | too small: good headings count for less; too large: repeated errors turn the robot |
/// | `max_sigma` | 3.0 | sigma | by hand | too large: one outlier counts as a repeated error |
/// | `nis_gain` | 0.01 | - | by hand: a hundred innovations of memory | too small: the stated covariance grows late; too large: it flickers |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhitenessParams {
    pub gain: f64,
    pub white_sigma: f64,
    pub max_sigma: f64,
    pub nis_gain: f64,
}

impl Default for WhitenessParams {
    fn default() -> Self {
        Self { gain: 0.1, white_sigma: 2.0, max_sigma: 3.0, nis_gain: 0.01 }
    }
}

pub use super::range_noise::NoiseParams;
pub use super::relocalize::RelocalizeParams;
pub use super::wheel_agreement::AgreementParams;

/// Differences between the tables and the defaults of a source: each row's value must stand in its struct's `Default`.
#[cfg(test)]
pub(crate) fn table_errors(source: &str) -> Vec<String> {
    let mut errors = Vec::new();
    let mut rows = Vec::new();
    let mut blocks = source.split("impl Default for ");
    let mut tables = blocks.next().unwrap_or_default();
    for block in blocks {
        rows.extend(tables.lines().filter_map(|line| line.strip_prefix("/// | `")).map(str::to_owned));
        let defaults = &block[..block.find("\n}").unwrap_or(block.len())];
        for row in rows.drain(..) {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let (name, value, unit) = (cells[0].trim_end_matches('`'), cells[1], cells[2]);
            let written = if unit == "deg" { format!("degrees({value})") } else { value.to_owned() };
            let field = format!("{name}: {written}");
            let is_there = |end: &str| defaults.contains(&format!("{field}{end}"));
            if cells.len() < 6 || ![",", " }"].iter().any(|end| is_there(end)) {
                errors.push(field);
            }
        }
        tables = &block[defaults.len()..];
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::table_errors;

    #[test]
    fn each_table_tells_the_defaults() {
        assert_eq!(table_errors(include_str!("params.rs")), Vec::<String>::new());
        assert_eq!(table_errors(include_str!("range_noise.rs")), Vec::<String>::new());
        assert_eq!(table_errors(include_str!("relocalize.rs")), Vec::<String>::new());
        assert_eq!(table_errors(include_str!("wheel_agreement.rs")), Vec::<String>::new());
        let wrong = include_str!("params.rs").replace("gate_sigma: 2.2", "gate_sigma: 2.3");
        assert_eq!(table_errors(&wrong), ["gate_sigma: 2.2"]);
    }
}
