//! Tuning of the alignment. The wire's facts (32-bit stamps, speed of sound) are constants where they are used.

/// Tuning of the alignment.
///
/// | name | value | unit | how chosen | what breaks |
/// |---|---|---|---|---|
/// | `reset_back_us` | 1,000,000 | µs | far above any message's delay: USB bridges hold bytes for 16 ms | less: a late message looks like a restart; more: a restart soon after boot goes unnoticed |
/// | `window_s` | 60 | s | resonators drift as they warm up; checked by `a_ping_is_dated_within_2_ms` | less: the rate is noisy; more: the rate is out of date |
/// | `max_trips` | 256 | 1 | a minute of time requests is 120 regular and 60 quick ones | less: shortens `window_s`; more: costs time per answer |
/// | `max_trip_s` | 1 | s | a slower answer bounds the clock by nothing useful | less: slow bridges get no clock; more: useless bounds are kept |
/// | `max_ahead_s` | 0.2 | s | above the error of a rate learned within a second | less: a young clock map is discarded; more: a jumped clock is kept |
/// | `max_rate` | 0.02 | 1 | twice the 1 % of the worst resonator | less: such a board is never in step; more: the search is coarser |
/// | `rate_prior_s` | 3e-4 | s | by hand; checked by `a_ping_is_dated_within_2_ms` | less: the rate follows jitter; more: a wrong first rate stays |
/// | `search_steps` | 36 | 1 | (2/3)^36 of the range is 0.01 ppm | less: a coarse rate; more: costs time per answer |
/// | `arrival_prior_s2` | 30 | s² | by hand, for boards that answer no time request | less: the rate follows jitter; more: a wrong first rate stays |
/// | `continues_s` | 0.5 | s | above any delay, and above the error of a rate after an hour of silence | less: the board is questioned again after each pause; more: a restart goes unnoticed |
/// | `min_heard` | 0.25 | 1 | by hand | less: sweeps of few beams; more: sweeps are dropped on a bad line |
/// | `track_samples` | 180 | 1 | two seconds at 50 encoder messages and 40 groups per second | less: late pings have no pose; more: costs memory |
/// | `extrapolate_s` | 0.03 | s | one slot between groups (25 ms) and a little | less: the pose lags when messages are missing; more: a stopped robot overshoots |
/// | `step_speed_factor` | 3 | 1 | times robot.max_speed_m_s: a wheel that slips turns faster than the robot drives, and one outside in a curve too | less: fast wheels are held back; more: small jumps are rolled |
/// | `step_slack_m` | 0.05 | m | stamps of foreign recordings jitter by 50 ms at 0.5 m/s | less: such rows are refused; more: jumps of this length are rolled |
/// | `restart_s` | 1 | s | the robot rolls on while its counter starts again | less: a restart is called a jump; more: a jump is called a restart |
/// | `bridge_s` | 0.5 | s | a robot keeps its speed this long | less: the travel of a lost interval is missing; more: a stopped robot rolls on |
/// | `rate_s` | 0.05 | s | two encoder messages and more: one tick is little of it | less: the bridged speed is rough; more: it lags |
/// | `same_speed` | 0.5 | 1 | two steps in a row of a robot that accelerates; jumps never resemble each other so | less: a wrong scale looks like jumps; more: jumps look like a wrong scale |
/// | `same_steps` | 5 | 1 | noise in place of counts repeats its steps that often once in 10,000 | less: noise looks like a wrong scale; more: the path of a wrong scale comes later |
/// | `pace_s` | 2 | s | above any jitter of stamps | less: jitter looks like speed; more: a wrong scale is said late |
/// | `pace_factor` | 1.25 | 1 | wheel radii are known to a few per cent | less: a fast robot is blamed; more: a scale wrong by less stays unsaid |
/// | `pace_count` | 3 | 1 | six seconds of steady excess: no slip lasts so long | less: a push by hand is blamed; more: said late |
/// | `back_s` | 0.35 | s | a group is stamped a slot (at most 60 ms, on foreign boards 250 ms) before it is sent | less: late messages are refused; more: a clock that runs back disorders the counts |
/// | `max_back_s` | 3 | s | such clocks were seen to run right again after one | less: wrong stamps are used; more: a clock that was set costs more sweeps |
/// | `unit_s` | 0.3 | s | above the 16 ms by which bridges delay: the unit is known within a factor of 2 | less: delays look like another unit; more: such stamps are believed longer |
/// | `unit_stamps` | 5 | 1 | stamps that come in one burst span less board time than host time | less: bursts look like milliseconds; more: known later |
/// | `rate_check_s` | 10 | s | the delays of bursts (1 s) are small against it | less: bursts look like a wrong rate; more: said late |
/// | `rate_tolerance` | 0.2 | 1 | ten times what `max_rate` follows | less: a pause looks like a wrong rate; more: a wrong rate stays unsaid |
/// | `min_air_c` | −20 | °C | cold stores | higher: such places are refused; lower: wrong sensors are believed |
/// | `max_air_c` | 55 | °C | hot halls; the speed of sound errs by 1 % per 6 K | lower: such places are refused; higher: wrong sensors are believed |
/// | `air_jump_k` | 2 | K | rooms differ by more, but a sensor follows within minutes | less: drafts are refused; more: jumps are believed |
/// | `air_drift_k_s` | 0.05 | K/s | 20 K outdoors within six minutes | less: a robot that goes outdoors keeps the old air; more: jumps are believed sooner |
/// | `max_cm_flight` | 620 | 1 | in centimetres above `ring.max_range_m` of usual sensors (4.5 m), in microseconds 0.1 m | less: centimetres are called microseconds; more: a ring in a narrow place is called centimetres |
/// | `unit_flights` | 100 | 1 | a second of a ring of 8: that no sensor sees farther than 0.1 m | less: a robot that starts against a box is taken wrong; more: the first ranges of such a board are missing for longer |
/// | `near_cm_flight` | 60 | 1 | in microseconds 1 cm, nearer than any sensor measures; in centimetres nearer than some wall of a room | less: centimetres are known later; more: microseconds beside a box are called centimetres |
/// | `decade_flights` | 300 | 1 | some seconds of a ring of 8 | less: chance decides; more: said late |
/// | `decade_near_us` | 2,800 | µs | 0.48 m: a tenth of the reach of usual sensors (4.5 m) | less: readings that are ten times too short are believed; more: a narrow place is called a wrong unit |
/// | `decade_beyond` | 5 | 1 | stray echoes | less: stray echoes hide a wrong unit; more: a narrow place is called a wrong unit |
/// | `decade_path_m` | 1.0 | m | a push of 0.3 m and a turn | less: a narrow place is called a wrong unit; more: said late |
/// | `decade_end_m` | 10 | m | a wrong unit shows within 2 m | less: a robot that starts in a narrow place is not checked; more: time is wasted |
/// | `decade_straight_m` | 0.25 | m | a push by hand | less: chance decides; more: a drill by hand tells nothing |
/// | `decade_step_m` | 0.003 | m | 0.03 m/s at 10 sweeps per second | less: noise counts as change; more: slow robots tell nothing |
/// | `decade_straight` | 0.25 | 1 | wheels that differ by less than this part of both together | less: wheels that differ tell nothing; more: turns count as travel |
/// | `decade_pings` | 20 | 1 | two seconds of a ring | less: chance decides; more: sparse sensors are left out |
/// | `decade_span` | 1.7 | 1 | in a corridor, readings of its walls vary less | less: a corridor is called a wrong unit; more: a wrong unit stays unsaid |
/// | `decade_varied` | 0.35 | 1 | simulated rooms: 0.1 for ten times too short, 1 for right ranges | less: a wrong unit stays unsaid; more: a narrow place is called a wrong unit |
/// | `decade_far_us` | 49,000 | µs | 8.4 m: twice the reach of usual sensors | less: ranges that count the way twice are called a wrong unit; more: a wrong unit stays unsaid |
/// | `decade_far_share` | 0.05 | 1 | rooms have walls at 0.85 to 1.1 m, which lie there ten times too far | less: stray echoes count; more: a wrong unit stays unsaid |
/// | `decade_far_ms` | 7 | ms | a timeout that is sent as an echo lies within one or two | less: timeouts are called a wrong unit; more: said late |
/// | `decade_least_us` | 700 | µs | 0.12 m: ten times what a sensor measures at least | less: walls that touch the robot hide it; more: right ranges with far timeouts are called wrong |
/// | `crosstalk_pings` | 40 | 1 | a second or more of changing echoes | less: chance looks like crosstalk; more: said late |
/// | `crosstalk_share` | 0.8 | 1 | echoes of different walls rarely agree to the microsecond, on boards that round to 58 µs in one of a few | less: rounding looks like crosstalk; more: partial crosstalk stays unsaid |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// A board stamp this far back means that the board restarted, microseconds.
    pub reset_back_us: i64,
    /// Arrivals and round trips older than this are forgotten, seconds.
    pub window_s: f64,
    /// No range in centimetres exceeds this, and most times of flight in microseconds do.
    pub max_cm_flight: u16,
    /// So many times of flight, all below that, are ranges in centimetres.
    pub unit_flights: u32,
    /// Centimetres of a ring whose least one exceeds this are known later.
    pub near_cm_flight: u16,
    /// So many times of flight show whether ranges are ten times too short or too long.
    pub decade_flights: u32,
    /// Ranges that are ten times too short never exceed this, microseconds.
    pub decade_near_us: u16,
    /// So many times of flight may exceed it.
    pub decade_beyond: u32,
    /// Travel over which all ranges are too short, metres.
    pub decade_path_m: f64,
    /// Part of it that is straight, metres.
    pub decade_straight_m: f64,
    /// Step of the wheels within a sweep that is one, metres.
    pub decade_step_m: f64,
    /// Difference of the wheels over their sum, on a straight way.
    pub decade_straight: f64,
    /// Travel after which the ranges are believed, metres.
    pub decade_end_m: f64,
    /// A sensor with so many times of flight is counted.
    pub decade_pings: u32,
    /// Greatest over least reading of a sensor that sees other walls.
    pub decade_span: f64,
    /// Changes of ranges that are too short, per travel.
    pub decade_varied: f64,
    /// No usual sensor measures such times of flight, microseconds.
    pub decade_far_us: u16,
    /// Share of such times of flight in ranges that are too long.
    pub decade_far_share: f64,
    /// Milliseconds over which they spread.
    pub decade_far_ms: u32,
    /// Ranges that are too long are never shorter than this, microseconds.
    pub decade_least_us: u16,
    /// Number of round trips kept.
    pub max_trips: usize,
    /// Round trips that take longer are ignored, seconds.
    pub max_trip_s: f64,
    /// A board clock further ahead of the host's has jumped, seconds.
    pub max_ahead_s: f64,
    /// Bound of the board clock's relative rate error.
    pub max_rate: f64,
    /// A rate that differs by 1 % from the previous one must widen the strip by this much, seconds.
    pub rate_prior_s: f64,
    /// Steps of the ternary search for the rate.
    pub search_steps: u32,
    /// Weight of the previous rate in the line through the arrivals, seconds squared.
    pub arrival_prior_s2: f64,
    /// A stamp this close to the expected one continues the board's clock, seconds.
    pub continues_s: f64,
    /// Sweeps with a smaller share of their sensors are dropped.
    pub min_heard: f64,
    /// Number of encoder samples kept.
    pub track_samples: usize,
    /// The last velocity holds this long after the newest encoder sample, seconds.
    pub extrapolate_s: f64,
    /// A wheel cannot be faster than this times the robot's highest speed.
    pub step_speed_factor: f64,
    /// A wheel's step may exceed what its highest speed allows by this much, metres.
    pub step_slack_m: f64,
    /// A counter that starts again shows less than the way of this time at the highest speed, seconds.
    pub restart_s: f64,
    /// Over a lost interval up to this long the wheels roll on as before; over a longer one they stand, seconds.
    pub bridge_s: f64,
    /// Interval over which the wheels' rates are measured, seconds.
    pub rate_s: f64,
    /// Two steps whose speeds differ by a smaller share of the larger one are one motion.
    pub same_speed: f64,
    /// So many steps of one motion in a row show a wrong scale.
    pub same_steps: u32,
    /// Interval over which the speed is compared with the highest one, seconds.
    pub pace_s: f64,
    /// The robot may exceed its highest speed by this factor.
    pub pace_factor: f64,
    /// This many intervals in a row above the highest speed are reported.
    pub pace_count: u32,
    /// Stamps this far behind the newest one mean that the board's clock runs backwards, seconds.
    pub back_s: f64,
    /// A clock that stays back longer was set, seconds.
    pub max_back_s: f64,
    /// Host time after which the unit of the stamps is judged, seconds.
    pub unit_s: f64,
    /// Number of different stamps for that.
    pub unit_stamps: u32,
    /// Host time over which the rate of the board's clock is judged, seconds.
    pub rate_check_s: f64,
    /// Largest relative error of that rate without a report.
    pub rate_tolerance: f64,
    /// Coldest plausible air, degrees Celsius.
    pub min_air_c: f64,
    /// Hottest plausible air, degrees Celsius.
    pub max_air_c: f64,
    /// Change of the air temperature that is always plausible, kelvin.
    pub air_jump_k: f64,
    /// Further plausible change, kelvin per second.
    pub air_drift_k_s: f64,
    /// Number of changed echoes of a pair of sensors before it is judged.
    pub crosstalk_pings: u32,
    /// Share of equal ones among them that is crosstalk.
    pub crosstalk_share: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            reset_back_us: 1_000_000,
            window_s: 60.0,
            max_cm_flight: 620,
            unit_flights: 100,
            near_cm_flight: 60,
            decade_flights: 300,
            decade_near_us: 2_800,
            decade_beyond: 5,
            decade_path_m: 1.0,
            decade_straight_m: 0.25,
            decade_step_m: 0.003,
            decade_straight: 0.25,
            decade_end_m: 10.0,
            decade_pings: 20,
            decade_span: 1.7,
            decade_varied: 0.35,
            decade_far_us: 49_000,
            decade_far_share: 0.05,
            decade_far_ms: 7,
            decade_least_us: 700,
            max_trips: 256,
            max_trip_s: 1.0,
            max_ahead_s: 0.2,
            max_rate: 0.02,
            rate_prior_s: 3e-4,
            search_steps: 36,
            arrival_prior_s2: 30.0,
            continues_s: 0.5,
            min_heard: 0.25,
            track_samples: 180,
            extrapolate_s: 0.03,
            step_speed_factor: 3.0,
            step_slack_m: 0.05,
            restart_s: 1.0,
            bridge_s: 0.5,
            rate_s: 0.05,
            same_speed: 0.5,
            same_steps: 5,
            pace_s: 2.0,
            pace_factor: 1.25,
            pace_count: 3,
            back_s: 0.35,
            max_back_s: 3.0,
            unit_s: 0.3,
            unit_stamps: 5,
            rate_check_s: 10.0,
            rate_tolerance: 0.2,
            min_air_c: -20.0,
            max_air_c: 55.0,
            air_jump_k: 2.0,
            air_drift_k_s: 0.05,
            crosstalk_pings: 40,
            crosstalk_share: 0.8,
        }
    }
}
