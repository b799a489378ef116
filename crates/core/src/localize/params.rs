//! The constants of localization in a known map.

/// The constants of localization: how cells of a new map score on the known one, when to search, and which match is accepted.
///
/// "By hand" means: set by hand and not measured alone; `cargo xtask localize` measures all of them
/// together. What follows a "by hand;" explains the value, it did not measure it.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `solid_percent` | 65 | % | by hand; a cell is solid from here on | lower: noise becomes walls; higher: young maps have no walls |
/// | `free_percent` | 35 | % | by hand; the mirror image of `solid_percent` | higher: unknown floor contradicts walls |
/// | `solid_by_distance` | 20, 16, 8 | marks | by hand; solid cells 0, 1 and 2 cells from a solid cell of the known map | flatter: position errors of a cell; steeper: range noise hides the fit |
/// | `solid_on_free` | −10 | marks | by hand; a contradiction | nearer to 0: wrong poses fit; lower: moved furniture hides the fit |
/// | `solid_elsewhere` | 10 | marks | half of a match, because maps have gaps | lower: a badly mapped half of a symmetrical building loses to the other |
/// | `free_elsewhere` | 3 | marks | by hand; there are many more free cells than solid ones | higher: free floor decides |
/// | `free_on_solid` | −10 | marks | as `solid_on_free` | nearer to 0: rooms fit across walls |
/// | `deep_cells` | 9 | cells | by hand; beams that miss a wall clear a little behind it (45 cm of 5 cm cells) | smaller: that floor contradicts walls; larger: corridors say nothing |
/// | `same_m` | 0.5 | m | by hand; solutions nearer than this, with the same heading, are one | smaller: a solution is its own rival; larger: a real rival is missed |
/// | `max_points` | 500 | points | by hand; bounds the time of a search, for solid and for free points each | smaller: a coarse fit; larger: a sweep takes too long |
/// | `max_cells` | 2²⁴ | cells | by hand; 200 m by 200 m of 5 cm cells, for which the search takes 270 MB | smaller: large buildings are refused; larger: memory |
/// | `search_m` | 0.5 | m | by hand; the travel from one search to the next | smaller: time, and searches that agree because they saw the same; larger: the pose is found late |
/// | `turn_m_per_rad` | 0.5 | m/rad | by hand; a radian of turning shows as much as this travel | smaller: a robot that turns is found late; larger: time |
/// | `min_solid` | 60 | cells | by hand; three metres of wall in 5 cm cells | smaller: a few cells fit anywhere; larger: the pose is found late |
/// | `min_fit` | 0.55 | of a perfect fit | by hand | smaller: another building is taken for the known one; larger: moved furniture hides the pose |
/// | `min_lead` | 0.15 | of a perfect fit | by hand; a rival that comes nearer is one | smaller: a symmetrical room is guessed at; larger: the pose is found late or never |
/// | `agree_m` | 0.25 | m | by hand; two searches in a row agree within this | smaller: the pose is found late; larger: chance agrees |
/// | `agree_rad` | 0.1 | rad | by hand; headings differ by quarter turns, so this only absorbs rounding | from π/2 on: every heading agrees |
/// | `found_sigma_m` | 0.08 | m | by hand; more than a cell, the search's step | smaller: walls fail the gate; larger: they match the wrong wall |
/// | `warning_s` | 60 | s | by hand; driving with an unknown pose until the warning | smaller: warnings in large halls; larger: a robot in the wrong building is noticed late |
/// | `lost_share` | 0.1 | of the sweeps | by hand; below this share of sweeps that match a wall the pose is lost | smaller: a lost robot notices late; larger: clutter gives false alarms |
/// | `share_gain` | 0.02 | | by hand; a memory of a hundred sweeps or so | smaller: a lost robot notices late; larger: clutter gives false alarms |
/// | `standstill_m` | 0.001 | m | by hand; the travel of both wheels in a sweep up to which the robot stands | smaller: a shaken robot seems to drive; larger: slow driving does not count |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub solid_percent: i8,
    pub free_percent: i8,
    pub solid_by_distance: [i8; 3],
    pub solid_on_free: i8,
    pub solid_elsewhere: i8,
    pub free_elsewhere: i8,
    pub free_on_solid: i8,
    pub deep_cells: i32,
    pub same_m: f64,
    pub max_points: usize,
    pub max_cells: usize,
    pub search_m: f64,
    pub turn_m_per_rad: f64,
    pub min_solid: usize,
    pub min_fit: f64,
    pub min_lead: f64,
    pub agree_m: f64,
    pub agree_rad: f64,
    pub found_sigma_m: f64,
    pub warning_s: f64,
    pub lost_share: f64,
    pub share_gain: f64,
    pub standstill_m: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            solid_percent: 65,
            free_percent: 35,
            solid_by_distance: [20, 16, 8],
            solid_on_free: -10,
            solid_elsewhere: 10,
            free_elsewhere: 3,
            free_on_solid: -10,
            deep_cells: 9,
            same_m: 0.5,
            max_points: 500,
            max_cells: 1 << 24,
            search_m: 0.5,
            turn_m_per_rad: 0.5,
            min_solid: 60,
            min_fit: 0.55,
            min_lead: 0.15,
            agree_m: 0.25,
            agree_rad: 0.1,
            found_sigma_m: 0.08,
            warning_s: 60.0,
            lost_share: 0.1,
            share_gain: 0.02,
            standstill_m: 1e-3,
        }
    }
}

impl Params {
    /// The marks of a perfect fit, per solid and per free point.
    pub(super) fn best_marks(&self) -> [i32; 2] {
        let [on_solid, ..] = self.solid_by_distance;
        [i32::from(on_solid), i32::from(self.free_elsewhere)]
    }

    /// The marks of a cell that the known map does not hold.
    pub(super) fn unknown_marks(&self) -> [i8; 2] {
        [self.solid_elsewhere, self.free_elsewhere]
    }
}
