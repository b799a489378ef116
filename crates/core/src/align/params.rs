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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// A board stamp this far back means that the board restarted, microseconds.
    pub reset_back_us: i64,
    /// Arrivals and round trips older than this are forgotten, seconds.
    pub window_s: f64,
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
}

impl Default for Params {
    fn default() -> Self {
        Self {
            reset_back_us: 1_000_000,
            window_s: 60.0,
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
        }
    }
}
