//! The constants of the default method.

/// The constants of [`super::WallSlam`], except those of the filter, the fault tests and the grid.
///
/// "Commit" names the commit whose message says so. "By design" follows from the argument given, without a measurement. "Not
/// measured since the first version" means that no record tells how the value was chosen when its stage was first written.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `resume_sigma_m` | 0.1 | m | not measured since the first version | Too small: a robot that was moved by hand is gated out. Too large: it may associate the wrong wall |
/// | `axis_sigma_rad` | 3 | degrees | not measured since the first version | Too small: a wrong axis bends the map. Too large: the axis corrects nothing |
/// | `min_sensors_to_correct` | 3 | sensors | board.py: one and two sensors drag a pose off exact wheels | Too small: the pose is worse than the encoders'. Too large: a small ring maps with its encoders alone |
/// | `min_sensors_to_detect_loss` | 12 | sensors | measured: with 8 sensors one drive in three raised a false alarm (commit "Heading from how misfits along a wall grow with a turn") | Too small: false alarms suspend mapping. Too large: a kidnapped robot with a small ring is not noticed |
/// | `vague_sigma_m` | 0.3 | m | by design: a silent error begins at 0.3 m | Too small: poses on the way through a hall are called uncertain. Too large: a robot that no wall corrects says nothing |
/// | `known_sigma_m` | 0.15 | m | by hand: half of `vague_sigma_m` | Near `vague_sigma_m`: the doubt comes and goes |
/// | `lost_within_m` | 3 | m | by hand: a room | Too small: the stated error of a lost robot is exceeded. Too large: a nudge looks like a journey |
/// | `same_pose_m` | 0.25 | m | not measured since the first version | Too small: a false alarm moves a robot that was right. Too large: it stays where it is not |
/// | `same_pose_rad` | 0.15 | rad | not measured since the first version | As `same_pose_m` |
/// | `catch_up_sweeps` | 8 | sweeps | not measured since the first version | Too small: the first poses come late. Too large: a sweep takes longer than the time to the next |
/// | `max_axis_off_rad` | 8 | degrees | by hand: more than wheels drift in a window | Too small: slanted furniture raises a doubt. Too large: a wrong heading is silent |
/// | `axis_fits` | 3 | windows | by design: 3 m with one axis | Too small: a building of slanted walls raises doubts. Too large: a heading that is lost early is silent |
/// | `mark_m` | 0.1 | m | by hand: sixteen marks are kept, so that what was drawn on the last 1.6 m can be taken back | Too small: what a pushed robot draws before that is noticed stays. Too large: good parts of the map are taken back |
/// | `mark_s` | 0.5 | s | by hand: of a robot that stands, the last eight seconds | As `mark_m` |
/// | `clearing_sweeps` | 8 | sweeps | not measured since the first version | Too small: time is wasted. Too large: moved furniture stays in the map |
/// | `on_wall_m` | 0.06 | m | not measured since the first version | Too small: walls are drawn thick. Too large: furniture near a wall disappears into it |
/// | `beyond_wall_end_m` | 1 | m | not measured since the first version | Too small: walls grow slowly. Too large: a wall is drawn across an opening |
/// | `ray_offsets` | 0, ±1, ±0.5 | half beam angles | by design: axis, edges, and half-way between | Too few or too narrow: the map promises echoes that are not there |
/// | `rays_for_open_view` | 3 | rays | by design: axis and edges | Too small: a narrow target is missed. Too large: time is wasted |
/// | `min_ray_spread_rad` | 0.05 | rad | by design: how well the heading is known | Too small: a heading error makes a healthy point beam look faulty |
/// | `well_known_log_odds` | 200 | 0.01 log-odds | not measured since the first version | Too small: a single echo promises the next. Too large: the map is no evidence |
/// | `min_cos_incidence` | 0.866 | 1 | by design: the cosine of 30 degrees, up to which a wall reflects a sonar | Too small: specular walls make healthy sensors look faulty. Too large: the map is no evidence |
/// | `range_margin_m` | 0.25 | m | not measured since the first version | Too small: walls at the limit of the range make healthy sensors look faulty. Too large: far walls are no evidence |
/// | `axis_every_sweeps` | 25 | sweeps | not measured since the first version | Too small: time is wasted. Too large: the map begins late |
/// | `axis_travel_m` | 192 | m × sensors² | by design: 3 m for 8 sensors, because returns must agree pair by pair | Too small: a sparse ring believes a wrong axis. Too large: the map begins late |
/// | `axis_min_travel_m` | 0.6 | m | by hand, on seeds 1-20 of the accuracy bench (commit "Heading from how misfits along a wall grow with a turn") | Too small: a lone slanted object near the start passes for the building. Too large: the map begins late |
/// | `search_steps` | 3 | steps | by design: the search is over before the next is due | Too small: the map begins late. Too large: a sweep takes longer than the time to the next |
/// | `axis_max_sweeps` | 300 | sweeps | not measured since the first version | Too small: an axis is missed. Too large: without an axis there is no pose for long, and memory grows |
/// | `max_peak_ratio` | 1.8 | 1 | not measured since the first version | Too small: slanted furniture passes for the building. Too large: the map begins late |
/// | `peak_ratio` | 2.4 | 1 | not measured since the first version | As `max_peak_ratio`, after little travel |
/// | `peak_ratio_per_m` | 0.2 | 1/m | not measured since the first version | As `max_peak_ratio`, reversed: it lowers the ratio with the travel |
/// | `refine_passes` | 2 | passes | measured: with odometry three times as bad the second reduces the error of the first heading by a fifth (commit "The first sweeps are followed to the last and back twice"); a third gains nothing | Too small: bad wheels turn the map. Too large: time is wasted |
/// | `refine_apart_rad` | 2 | degrees | not measured since the first version | Too small: a good axis is ignored. Too large: bad wheels turn the map |
/// | `sign_flip_jump_m` | 0.02 | m | not measured since the first version | Too small: noise passes for the flip. Too large: a flip at speed is sought at a standstill. Both misplace the robot until it is relocalized |
/// | `history_sweeps` | 120 | sweeps | by design: twelve seconds, longer than an encoder fault takes to be declared | Too small: the last good pose is gone. Too large: memory is wasted |
/// | `start_fault_sweeps` | 10 | sweeps | not measured since the first version | Too small: a map drawn with a faulty encoder is kept. Too large: a good map is discarded |
/// | `relocalize_first_sweeps` | 20 | sweeps | not measured since the first version | Too small: few returns fit in many poses. Too large: the map is suspended for longer |
/// | `relocalize_every_sweeps` | 5 | sweeps | not measured since the first version | Too small: time is wasted. Too large: the map is suspended for longer |
/// | `relocalize_max_returns` | 1000 | returns | not measured since the first version | Too small: returns fit in many poses. Too large: the wheels have drifted since the oldest |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Standard deviation of the position after a resume, metres.
    pub resume_sigma_m: f64,
    /// Standard deviation of a heading read off the axis, radians.
    pub axis_sigma_rad: f64,
    /// A ring with fewer sensors does not correct the pose.
    pub min_sensors_to_correct: usize,
    /// Sensors that a ring needs for the loss of localization to be declared.
    pub min_sensors_to_detect_loss: usize,
    /// The pose is doubted above this standard deviation of the position, metres.
    pub vague_sigma_m: f64,
    /// And no more below this one, metres.
    pub known_sigma_m: f64,
    /// Standard deviation of the position of a lost robot, metres.
    pub lost_within_m: f64,
    /// A pose found within this distance of the estimate does not move it, metres.
    pub same_pose_m: f64,
    /// The same for the heading, radians.
    pub same_pose_rad: f64,
    /// Collected sweeps that are processed with each new one.
    pub catch_up_sweeps: usize,
    /// Axes that are farther apart are not the same, radians.
    pub max_axis_off_rad: f64,
    /// Windows with the map's axis after which another one is a contradiction.
    pub axis_fits: usize,
    /// A sensor clears its cone in one of so many sweeps.
    pub clearing_sweeps: u64,
    /// What is drawn can be taken back in parts of so many metres,
    pub mark_m: f64,
    /// or seconds.
    pub mark_s: f64,
    /// A return this near a known wall's line is that wall's, metres.
    pub on_wall_m: f64,
    /// It may lie this far beyond the end of the wall, metres.
    pub beyond_wall_end_m: f64,
    /// Rays across a beam, in half opening angles off its axis.
    pub ray_offsets: [f64; 5],
    /// If none of the first so many rays ends, the view is open.
    pub rays_for_open_view: usize,
    /// The rays reach at least this far to either side, radians.
    pub min_ray_spread_rad: f64,
    /// From this on a cell is well known, hundredths of log-odds.
    pub well_known_log_odds: i16,
    /// Cosine of the incidence up to which a wall reflects.
    pub min_cos_incidence: f64,
    /// A target nearer to the maximum range than this may be missed, metres.
    pub range_margin_m: f64,
    /// Collected sweeps from one search of the axis to the next.
    pub axis_every_sweeps: usize,
    /// Travel before the first search, times the square of the ring's sensors, metres.
    pub axis_travel_m: f64,
    /// Travel before the first search, at least, metres.
    pub axis_min_travel_m: f64,
    /// Steps of the search in one sweep.
    pub search_steps: usize,
    /// After so many sweeps the map begins with or without an axis.
    pub axis_max_sweeps: usize,
    /// The axis must beat every other direction by this ratio, at most.
    pub max_peak_ratio: f64,
    /// The ratio before any travel.
    pub peak_ratio: f64,
    /// What each metre of travel takes off the ratio: the longer the way, the more of the building is seen.
    pub peak_ratio_per_m: f64,
    /// Passes over the first sweeps, to the last and back.
    pub refine_passes: usize,
    /// Two headings this far apart leave a fifth of the weight to the first, radians.
    pub refine_apart_rad: f64,
    /// Minimum jump in wheel travel over two sweeps that counts as a sign flip, metres.
    pub sign_flip_jump_m: f64,
    /// Poses kept to go back to.
    pub history_sweeps: usize,
    /// An encoder fault this soon after the first sweep was there from the start.
    pub start_fault_sweeps: u64,
    /// Sweeps before the first search for the pose.
    pub relocalize_first_sweeps: u32,
    /// Sweeps from one search to the next.
    pub relocalize_every_sweeps: u32,
    /// Returns kept for the search.
    pub relocalize_max_returns: usize,
}

impl Params {
    /// True if a pose that was found is the believed one: the robot never was elsewhere.
    pub(super) fn is_same_pose(&self, moved_m: f64, turned_rad: f64) -> bool {
        moved_m <= self.same_pose_m && turned_rad.abs() <= self.same_pose_rad
    }
}

impl Default for Params {
    fn default() -> Self {
        Self {
            resume_sigma_m: 0.1,
            axis_sigma_rad: 3.0 * std::f64::consts::PI / 180.0,
            min_sensors_to_correct: 3,
            min_sensors_to_detect_loss: 12,
            vague_sigma_m: 0.3,
            known_sigma_m: 0.15,
            lost_within_m: 3.0,
            same_pose_m: 0.25,
            same_pose_rad: 0.15,
            catch_up_sweeps: 8,
            max_axis_off_rad: 8.0 * std::f64::consts::PI / 180.0,
            axis_fits: 3,
            clearing_sweeps: 8,
            mark_m: 0.1,
            mark_s: 0.5,
            on_wall_m: 0.06,
            beyond_wall_end_m: 1.0,
            ray_offsets: [0.0, -1.0, 1.0, -0.5, 0.5],
            rays_for_open_view: 3,
            min_ray_spread_rad: 0.05,
            well_known_log_odds: 200,
            min_cos_incidence: 0.866,
            range_margin_m: 0.25,
            axis_every_sweeps: 25,
            axis_travel_m: 3.0 * 8.0 * 8.0,
            axis_min_travel_m: 0.6,
            search_steps: 3,
            axis_max_sweeps: 300,
            max_peak_ratio: 1.8,
            peak_ratio: 2.4,
            peak_ratio_per_m: 0.2,
            refine_passes: 2,
            refine_apart_rad: 2.0 * std::f64::consts::PI / 180.0,
            sign_flip_jump_m: 0.02,
            history_sweeps: 120,
            start_fault_sweeps: 10,
            relocalize_first_sweeps: 20,
            relocalize_every_sweeps: 5,
            relocalize_max_returns: 1_000,
        }
    }
}
