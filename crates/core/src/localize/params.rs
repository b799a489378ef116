//! The constants of the search for a new map in a known one.

/// The constants of the search: how cells of a new map score on a known one, and which solutions are the same.
///
/// "By hand" means: set by hand and not measured alone; `cargo bench --no-default-features --bench localize` measures all of them
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
