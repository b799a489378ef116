//! The constants of mapping.

/// The constants of the occupancy grid and of the inverse sensor model. Log-odds are in hundredths.
///
/// "By hand" means: set by hand; together the values give the map precision and coverage of `docs/accuracy.md`
/// (`slamd bench accuracy --table issue`), no value was measured alone.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `floor` | −320 | 0.01 | by hand, p = 0.04; clamped as in Probabilistic Robotics, ch. 9 | lower: a new obstacle appears late |
/// | `ceiling` | 400 | 0.01 | by hand, p = 0.98 | higher: a moved obstacle stays in the map |
/// | `free` | −24 | 0.01 | by hand; beams with an echo | nearer to 0: the floor stays unknown; lower: thin obstacles vanish |
/// | `free_unheard` | −8 | 0.01 | by hand; a third of `free`, because silence may be a mirror | lower: steep walls are cleared |
/// | `contradicted` | −12 | 0.01 | by hand; half of `free` | lower: small obstacles vanish; nearer to 0: false ones stay |
/// | `wall_contradicted` | −60 | 0.01 | by hand; a wall that should have thrown the sound back | nearer to 0: false walls stay |
/// | `wall` | 28 | 0.01 | by hand | higher: a wrong association draws a wall at once |
/// | `wall_beside` | 14 | 0.01 | half of `wall`; the neighbours along the wall | higher: walls grow past their ends; 0: walls have gaps |
/// | `known` | 30 | 0.01 | by hand; a return that an occupied cell explains | higher: false obstacles become certain |
/// | `arc_total` | 60 | 0.01 | by hand; shared by the cells of an arc, so that returns from several poses must agree | higher: walls become arcs |
/// | `opaque` | 120 | 0.01 | by hand, p = 0.77; from here on a cell stops a ray | lower: one return hides what lies behind; higher: rays go through walls |
/// | `cleared_part` | 0.7 | of the half angle | by hand; the rim of the cone hears weakly | larger: obstacles at the rim are cleared; smaller: coverage |
/// | `unheard_part` | 0.6 | of the range | by hand; far surfaces may not answer | larger: far walls are cleared; smaller: coverage in halls |
/// | `shortfall_cells` | 1.5 | cells | by hand; clearing stops this far before the return | smaller: range noise clears the wall itself |
/// | `sin_mirror` | 0.5 | | by hand; the sine of 30° of incidence | larger: steep walls are cleared; smaller: false walls stay |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub floor: i16,
    pub ceiling: i16,
    pub free: i16,
    pub free_unheard: i16,
    pub contradicted: i16,
    pub wall_contradicted: i16,
    pub wall: i16,
    pub wall_beside: i16,
    pub known: i16,
    pub arc_total: f64,
    pub opaque: i16,
    pub cleared_part: f64,
    pub unheard_part: f64,
    pub shortfall_cells: f64,
    pub sin_mirror: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            floor: -320,
            ceiling: 400,
            free: -24,
            free_unheard: -8,
            contradicted: -12,
            wall_contradicted: -60,
            wall: 28,
            wall_beside: 14,
            known: 30,
            arc_total: 60.0,
            opaque: 120,
            cleared_part: 0.7,
            unheard_part: 0.6,
            shortfall_cells: 1.5,
            sin_mirror: 0.5,
        }
    }
}
