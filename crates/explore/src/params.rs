//! The constants of the exploration.

/// The constants of the exploration.
///
/// "Homes 1-20" are drives of `cargo xtask explore` with these seeds.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `body_radius_m` | 0.17 | m | the simulated robot's; a caller sets its own robot's | Too small: contacts. Too large: doors are too narrow |
/// | `margin_m` | 0.05 | m | by design: one cell | Too small: contacts. Too large: doors are too narrow |
/// | `comfort_m` | 0.45 | m | by hand: the middle of a narrow hallway | Too small: ways along walls. Too large: detours |
/// | `nearness_cost` | 4 | 1 | by hand: how many times a way along a wall counts | As `comfort_m` |
/// | `occupied_percent` | 65 | % | by design: more than one echo | Too small: ghosts block doors. Too large: thin legs are not seen |
/// | `free_percent` | 45 | % | by design: below the prior | Too small: too little floor is free. Too large: shadows are entered |
/// | `undecided_percent` | 55 | % | by design: as far above the prior | Too small: weakly cleared floor hides the frontier beside it. Too large: edges of walls are frontiers |
/// | `trail_m` | 0.08 | m | by design: the way itself | Too large: ways through furniture |
/// | `trail_factor` | 15 | 1 | by hand: a detour of this many metres instead of a metre where the map is against it | Too small: it runs at closed doors. Too large: nothing but detours |
/// | `block_radius_m` | 0.1 | m | by hand: a leg and the noise of a range | Too small: the same way is tried again. Too large: a door is closed |
/// | `block_s` | 25 | s | by hand: a person goes on | Too small: the same way is tried again. Too large: detours |
/// | `min_frontier` | 4 | cells | by hand: 0.2 m at 5 cm | Too small: gaps between beams are visited. Too large: corners stay unknown |
/// | `max_frontier` | 24 | cells | by hand: 1.2 m | Too large: one place for a long frontier |
/// | `view_m` | 0.9 | m | by hand: where neighbouring beams of eight nearly touch | Too small: the robot goes up to every wall. Too large: gaps stay |
/// | `near_gain` | 2 | m of way per m | by hand: so much longer a way is worth it to see a frontier from nearer | Too small: doors are not entered. Too large: it goes up to every gap |
/// | `min_gap` | 12 | cells | by hand: 0.6 m | Too small: gaps in walls are visited. Too large: rooms behind narrow doors stay unknown |
/// | `gain_m` | 1 | m of way per m of frontier | by hand | Too small: small gaps first. Too large: far rooms first |
/// | `ahead_m_rad` | 0.3 | m/rad | by hand: turns take time | Too large: a near frontier behind is left |
/// | `stay_m` | 0.3 | m | by hand: half a chunk of a frontier | Too small: a goal changes often. Too large: the goal is another frontier |
/// | `looked_m` | 0.3 | m | by hand | Too small: the same gap is visited again. Too large: new frontiers are skipped |
/// | `max_tries` | 3 | tries | by hand | Too small: a person makes a room unreachable. Too large: time |
/// | `retry_s` | 30 | s | by hand: a door opens, a person goes | As `max_tries` |
/// | `patience_s` | 20 | s | by hand: beyond four times the way's time | As `max_tries` |
/// | `map_period_s` | 1 | s | by design: 20 cm of way | Too small: computing. Too large: late ways |
/// | `escape_m` | 0.3 | m | by design: from what is too near | Too small: a robot beside a wall has no way. Too large: ways through walls |
/// | `look_ahead_m` | 0.45 | m | by hand: two seconds | Too small: it swings. Too large: corners are cut |
/// | `on_the_spot_rad` | 0.6 | rad | by hand: 35 degrees | Too small: it turns at every bend. Too large: wide curves |
/// | `speed_m_s` | 0.2 | m/s | `drive.max_speed_m_s` | - |
/// | `turn_rad_s` | 0.8 | rad/s | below `drive.max_turn_rad_s` | - |
/// | `turn_gain` | 2 | 1/s | by hand | Too small: wide curves. Too large: it swings |
/// | `brake_m` | 0.4 | m | by design: two seconds | Too small: it drives past the end |
/// | `arrived_m` | 0.12 | m | by hand: two cells | Too small: it turns around its goal |
/// | `home_m` | 0.04 | m | by design: a cell | As `arrived_m` |
/// | `near_home_m` | 0.6 | m | by hand: as near as it gets where its place is taken | Too small: no way home. Too large: it ends too early |
/// | `side_m` | 0.04 | m | by design: a cell | Too small: contacts. Too large: doors block |
/// | `stop_gap_m` | 0.14 | m | by design: a little more than `board.stop_distance_mm` 120, which doors need | Too small: the board stops first |
/// | `back_gap_m` | 0.14 | m | as `stop_gap_m` | As `stop_gap_m` |
/// | `stop_time_s` | 1.2 | s | by design: a sweep, a command, a ramp | Too small: contacts |
/// | `graze_m` | 0.06 | m | by hand | Too small: contacts at speed. Too large: slow in doors |
/// | `graze_speed_m_s` | 0.08 | m/s | by hand | As `graze_m` |
/// | `wait_s` | 2.5 | s | by hand: a person passes | Too small: needless detours. Too large: time |
/// | `back_m_s` | 0.08 | m/s | by hand | - |
/// | `back_s` | 1.5 | s | by hand: 12 cm | Too small: the same place again |
/// | `stall_s` | 5 | s | by hand | Too small: a slow turn is a stall. Too large: time |
/// | `stall_m`, `stall_rad` | 0.1, 0.4 | m, rad | by hand: less than this within `stall_s` is a stall | Too small: creeping is no stall. Too large: slow driving is one |
/// | `max_blocks` | 4 | blocks | by hand: then another goal | As `max_tries` |
/// | `look_s` | 1.5 | s | by design: a map and some sweeps | Too small: nothing new was drawn |
/// | `uncertain_s` | 2 | s | by hand: the estimator recovers while it stands | Too small: it moves in doubt. Too large: time |
/// | `wander_m_s` | 0.12 | m/s | by hand: slow | - |
/// | `wander_turn_rad_s` | 0.6 | rad/s | by hand | - |
/// | `wander_turn_s` | 1.5 | s | by hand: 50 degrees | Too small: it turns back to where it came from. Too large: it misses a way |
/// | `wander_gap_m` | 0.1 | m | by hand | Too small: it stops and goes |
/// | `revisit_sigma_m` | 0.15 | m | by hand | Too small: it turns back often. Too large: rooms are drawn askew |
/// | `revisit_way_m` | 15 | m | by hand: no more often than that | As `revisit_sigma_m` |
/// | `pause_s` | 10 | s | by hand: a drive by the echoes between two tries to go home | Too small: the same trap again. Too large: it gets lost |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub body_radius_m: f64,
    pub margin_m: f64,
    pub comfort_m: f64,
    pub nearness_cost: f64,
    pub occupied_percent: i8,
    pub free_percent: i8,
    pub undecided_percent: i8,
    pub trail_m: f64,
    pub trail_factor: u32,
    pub block_radius_m: f64,
    pub block_s: f64,
    pub min_frontier: usize,
    pub max_frontier: usize,
    pub view_m: f64,
    pub near_gain: f64,
    pub min_gap: usize,
    pub gain_m: f64,
    pub ahead_m_rad: f64,
    pub stay_m: f64,
    pub looked_m: f64,
    pub max_tries: u32,
    pub retry_s: f64,
    pub patience_s: f64,
    pub map_period_s: f64,
    pub escape_m: f64,
    pub look_ahead_m: f64,
    pub on_the_spot_rad: f64,
    pub speed_m_s: f64,
    pub turn_rad_s: f64,
    pub turn_gain: f64,
    pub brake_m: f64,
    pub arrived_m: f64,
    pub home_m: f64,
    pub near_home_m: f64,
    pub side_m: f64,
    pub stop_gap_m: f64,
    pub back_gap_m: f64,
    pub stop_time_s: f64,
    pub graze_m: f64,
    pub graze_speed_m_s: f64,
    pub wait_s: f64,
    pub back_m_s: f64,
    pub back_s: f64,
    pub stall_s: f64,
    pub stall_m: f64,
    pub stall_rad: f64,
    pub max_blocks: u32,
    pub look_s: f64,
    pub uncertain_s: f64,
    pub wander_m_s: f64,
    pub wander_turn_rad_s: f64,
    pub wander_turn_s: f64,
    pub wander_gap_m: f64,
    pub revisit_sigma_m: f64,
    pub revisit_way_m: f64,
    pub pause_s: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            body_radius_m: 0.17,
            margin_m: 0.05,
            comfort_m: 0.45,
            nearness_cost: 4.0,
            occupied_percent: 65,
            free_percent: 45,
            undecided_percent: 55,
            trail_m: 0.08,
            trail_factor: 15,
            block_radius_m: 0.1,
            block_s: 25.0,
            min_frontier: 4,
            max_frontier: 24,
            view_m: 0.9,
            near_gain: 2.0,
            min_gap: 12,
            gain_m: 1.0,
            ahead_m_rad: 0.3,
            stay_m: 0.3,
            looked_m: 0.3,
            max_tries: 3,
            retry_s: 30.0,
            patience_s: 20.0,
            map_period_s: 1.0,
            escape_m: 0.3,
            look_ahead_m: 0.45,
            on_the_spot_rad: 0.6,
            speed_m_s: 0.2,
            turn_rad_s: 0.8,
            turn_gain: 2.0,
            brake_m: 0.4,
            arrived_m: 0.12,
            home_m: 0.04,
            near_home_m: 0.6,
            side_m: 0.04,
            stop_gap_m: 0.14,
            back_gap_m: 0.14,
            stop_time_s: 1.2,
            graze_m: 0.06,
            graze_speed_m_s: 0.08,
            wait_s: 2.5,
            back_m_s: 0.08,
            back_s: 1.5,
            stall_s: 5.0,
            stall_m: 0.1,
            stall_rad: 0.4,
            max_blocks: 4,
            look_s: 1.5,
            uncertain_s: 2.0,
            wander_m_s: 0.12,
            wander_turn_rad_s: 0.6,
            wander_turn_s: 1.5,
            wander_gap_m: 0.1,
            revisit_sigma_m: 0.15,
            revisit_way_m: 15.0,
            pause_s: 10.0,
        }
    }
}
