//! The constants of the check of the place.

use crate::geometry::degrees;

/// The constants of the check of the place.
///
/// "Homes 1-60" are drives of `cargo xtask never-silent` with these seeds. A log-likelihood is in nats, of "elsewhere" against "here".
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `rays` | 0, ±1, ±0.5 | half beam angles | by design: axis, edges, half-way between | Too few: surfaces are missed. Too many: time is wasted |
/// | `min_spread_rad` | 0.05 | rad | by design: how well the heading is known | Too small: a heading error contradicts the map with a point beam |
/// | `silent_margin_m` | 0.25 | m | as `range_margin_m` | Too small: surfaces at the limit of the range contradict. Too large: silence tells nothing |
/// | `near_m` | 0.12 | m | by hand: two cells and the noise of a range | Too small: noise contradicts the map. Too large: a pushed robot does not notice |
/// | `through_m` | 0.2 | m | by hand | As `near_m` |
/// | `around_m` | 0.1 | m | by hand: two cells before the range must be free as well | Too small: a return just before an unknown cell contradicts |
/// | `start_m` | 0.05 | m | by design: a sensor does not stand in a surface | Too large: near surfaces are missed |
/// | `occupied` | 100 | 0.01 log-odds | by hand | Too small: a single echo explains the next. Too large: thin surfaces do not explain |
/// | `solid` | 200 | 0.01 log-odds | as `well_known_log_odds` | Too small: a single echo contradicts the next. Too large: the map is no evidence |
/// | `free` | −50 | 0.01 log-odds | by hand: two beams with an echo | Too near to 0: what is hardly known contradicts. Too low: the map is no evidence |
/// | `min_cos_incidence` | 0.866 | 1 | by design: the cosine of 30 degrees, up to which a wall reflects a sonar | Too small: specular walls contradict. Too large: walls are no evidence |
/// | `weights` | −1.4, 0, 1.8, 2, 3, 4, 2.1 | nats | measured: shares of each outcome at the true pose and at others of the drive, homes 1-12 with 8 and 16 sensors; "unknown" set to 0 | Too extreme: clutter is taken for another place. Too near to 0: a carried robot notices late |
/// | `independent_m` | 0.3 | m | by hand: a beam sees another surface after this way | Too small: one piece of furniture counts often. Too large: a carried robot notices late |
/// | `turn_m_per_rad` | 0.15 | m/rad | by hand: a turn shows a beam other surfaces, too | As `independent_m` |
/// | `max_step_m` | 0.1 | m | by hand | Too large: one sweep decides |
/// | `max_beams` | 8 | beams | by design: more beams of one ring overlap | Too large: a ring of 32 is overconfident |
/// | `leak_per_m` | 1 | nats/m | by hand | Too small: in a new room an old suspicion lasts and nothing is drawn. Too large: a carried robot notices late |
/// | `jump_m` | 0.3 | m | by hand | Too small: noise looks like a jump. Too large: a carried robot is noticed later, by the map |
/// | `jump_heard_m` | 2 | m | by hand: farther surfaces are sometimes not heard | As `jump_m` |
/// | `jump_way_m` | 0.05 | m | by design: a sweep at 0.5 m/s | Too small: a robot carried while its wheels turn is noticed later. Too large: driving looks like a jump |
/// | `jump_turn_rad` | 3 | deg | by hand | As `jump_way_m` |
/// | `jump_beams` | 6 | beams | measured: drives in homes 1-12 with 8 sensors change up to 5 of 8 in a sweep | Too small: a person looks like a jump. Too large: no ring of 8 notices |
/// | `jump_share` | 0.8 | of the readings | by hand | As `jump_beams` |
/// | `still_m` | 0.005 | m | by design: the wheels stand | Too small: vibration hides a jump. Too large: slow driving looks like a jump |
/// | `still_rad` | 0.3 | deg | as `still_m` | As `still_m` |
/// | `still_beams` | 4 | beams | measured: robots that stand in homes 1-12 change up to 3 of 6; carried ones 4 to 6 of 8 | Too small: a person looks like a jump. Too large: no ring of 8 notices |
/// | `still_share` | 0.5 | of the readings | as `still_beams` | As `still_beams` |
/// | `jump_sigmas` | 8 | standard deviations of a reading | by hand: two readings differ | Too small: noisy readings jump. Too large: as `jump_m` |
/// | `shift_m` | 0.08 | m | by hand: four times the noise of a range | Too small: noise looks like a push. Too large: a small push is not noticed |
/// | `shift_sigmas` | 5 | standard deviations of a reading | as `jump_sigmas` | As `shift_m` |
/// | `shift_sweeps` | 3 | sweeps | by hand | Too small: single outliers look like a push. Too large: a robot that drives on at once is not noticed |
/// | `shift_beams` | 3 | beams | by design: of eight sensors the two ahead and behind do not see a push | Too small: a person looks like a push. Too large: as `shift_m` |
/// | `shift_share` | 0.4 | of the readings | as `shift_beams` | As `shift_beams` |
/// | `suspect` | 1.5 | nats | measured: homes 1-12 stay below but for persons and doors | Too small: the map is suspended often. Too large: a false map is drawn |
/// | `contradicted` | 3 | nats | by hand: between the two | Too small: the true pose is rejected. Too large: a wrong one is tried for long |
/// | `lost` | 7 | nats | measured: well tracked drives in homes 1-12 stay below 3; with 5, three of sixty drives in homes 1-20 are lost without need | Too small: false alarms. Too large: a carried robot notices late |
/// | `search` | see there | - | [`SearchParams`] | |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    pub rays: [f64; 5],
    pub min_spread_rad: f64,
    pub silent_margin_m: f64,
    pub near_m: f64,
    pub through_m: f64,
    pub around_m: f64,
    pub start_m: f64,
    pub occupied: i16,
    pub solid: i16,
    pub free: i16,
    pub min_cos_incidence: f64,
    pub weights: [f64; 7],
    pub independent_m: f64,
    pub turn_m_per_rad: f64,
    pub max_step_m: f64,
    pub max_beams: usize,
    pub leak_per_m: f64,
    pub jump_m: f64,
    pub jump_heard_m: f64,
    pub jump_way_m: f64,
    pub jump_turn_rad: f64,
    pub jump_beams: usize,
    pub jump_share: f64,
    pub still_m: f64,
    pub still_rad: f64,
    pub still_beams: usize,
    pub still_share: f64,
    pub jump_sigmas: f64,
    pub shift_m: f64,
    pub shift_sigmas: f64,
    pub shift_sweeps: u32,
    pub shift_beams: usize,
    pub shift_share: f64,
    pub suspect: f64,
    pub contradicted: f64,
    pub lost: f64,
    pub search: SearchParams,
}

/// The constants of the search for a lost robot.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `trail_m` | 2.5 | m | by hand: the wheels know their way over so much | Too small: many places fit. Too large: the wheels have drifted since the oldest reading |
/// | `spacing_m` | 0.04 | m | by hand | Too small: memory. Too large: few readings |
/// | `first_m` | 0.4 | m | by hand: the way before the first search | Too small: many places fit. Too large: a pushed robot is mended late |
/// | `every_m` | 0.3 | m | by hand: the way from one search to the next | Too small: time is wasted. Too large: the pose is found late |
/// | `scanned` | 64 | returns | by hand: bounds the time of a search | Too small: the true pose is not among the candidates. Too large: the search takes long |
/// | `per_sweep` | 3000 | poses | by hand: about a millisecond | Too small: the search takes long. Too large: a sweep does |
/// | `pitch_m` | 0.1 | m | by design: two cells; what is two cells off still scores | Too large: the true pose is missed. Too small: time |
/// | `near_m` | 0.75 | m | by design: a push goes up to 0.5 m | Too small: a pushed robot is sought everywhere. Too large: time |
/// | `near_until_m` | 3 | m | by hand: on this way after the loss a near pose is likelier than any other | Too small: a pushed robot is found late. Too large: a carried one is found near by chance |
/// | `near_rad` | 12 | deg | by hand | As `near_m` |
/// | `turned_rad` | 100 | deg | by hand: wheels that slip for a second turn a robot by up to 70 degrees where it stands | Too small: such a robot is found late. Too large: the other end of an alike room is near |
/// | `turned_penalty` | 4 | nats | by hand: the log prior of a robot that was turned where it stands, against one that was pushed or never lost | Too small: one of two alike headings is chosen by chance. Too large: a robot that was turned is found late |
/// | `carried_penalty` | 5 | nats | by design: the log prior of one place and heading among two hundred, in a home of 25 m² | Too small: a pushed robot is found at the other end of an alike room. Too large: a carried one is found late |
/// | `near_step_rad` | 3 | deg | by hand | As `pitch_m` |
/// | `candidates` | 24 | poses | by hand | Too small: the true pose or its rival is missed. Too large: time |
/// | `apart_m` | 0.5 | m | by design: another place begins here | Too small: neighbours of the best pose are its rivals. Too large: a true rival is not one |
/// | `apart_rad` | 20 | deg | by design | As `apart_m` |
/// | `min_explained` | 0.86 | of the readings of which the map tells | homes 1-60 | Too small: wrong poses. Too large: clutter hides the true one |
/// | `rival_explained` | 0.6 | of those | homes 1-60: clutter hides as much at the true pose | Too small: the robot stays lost. Too large: the true place is no rival of a wrong one |
/// | `min_told` | 0.6 | of the readings | homes 1-60 | Too small: a few readings fit anywhere. Too large: at the rim of the map the robot stays lost |
/// | `min_lead` | 6 | nats | homes 1-60 | Too small: one of two alike rooms is chosen by chance. Too large: the robot stays lost |
/// | `min_lead_share` | 0.38 | of the likelihood | homes 1-12: of places that were found wrongly, all but one led by less, of those found rightly one in thirty | As `min_lead` |
/// | `min_near_lead` | 3 | nats | homes 1-60: a push is likelier than a kidnap | As `min_lead`, for a pushed robot and a false alarm |
/// | `min_finds` | 2 | searches | by hand: so many must find a far pose | Too small: the same readings agree with themselves. Too large: found late |
/// | `min_near_explained` | 0.65 | as `min_explained` | homes 1-60 | As `min_explained`, for a pushed robot and a false alarm |
/// | `min_turned_explained` | 0.75 | as `min_explained` | homes 1-12: wrong poses that are turned explain 0.72 | As `min_explained`, for a robot that was turned |
/// | `min_near_told` | 0.3 | as `min_told` | homes 1-60 | As `min_told`, for a pushed robot and a false alarm |
/// | `again_m` | 0.5 | m | by hand: the way over which they must | Too small: the same readings agree with themselves. Too large: found late |
/// | `trial_m` | 2.5 | m | by hand: the way over which a far pose that was found must agree with the map before it is stated | Too small: a place that looks alike is taken for the true one. Too large: found late |
/// | `near_trial_m` | 0.7 | m | by hand: the same for a near one | As `trial_m` |
/// | `near_trial_explained` | 0.72 | as `min_explained` | homes 1-12: wrong near poses explain 0.68 | As `trial_explained`, for a near pose |
/// | `near_trial_told` | 0.25 | as `min_told` | homes 1-12: wrong near poses are told 0.17 | As `trial_told`, for a near pose |
/// | `trial_explained` | 0.75 | as `min_explained` | homes 1-20: 0.86 rejects half of the true poses, at the rim of the map or among persons | Too small: wrong poses. Too large: the true one is rejected |
/// | `trial_told` | 0.4 | as `min_told` | as `trial_explained` | As `trial_explained` |
/// | `same_m` | 0.3 | m | by hand: two searches agree | Too small: drift hides the pose. Too large: chance agrees |
/// | `same_rad` | 10 | deg | by hand | As `same_m` |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchParams {
    pub trail_m: f64,
    pub spacing_m: f64,
    pub first_m: f64,
    pub every_m: f64,
    pub scanned: usize,
    pub per_sweep: usize,
    pub pitch_m: f64,
    pub near_m: f64,
    pub near_until_m: f64,
    pub near_rad: f64,
    pub turned_rad: f64,
    pub turned_penalty: f64,
    pub carried_penalty: f64,
    pub near_step_rad: f64,
    pub candidates: usize,
    pub apart_m: f64,
    pub apart_rad: f64,
    pub min_explained: f64,
    pub rival_explained: f64,
    pub min_told: f64,
    pub min_lead: f64,
    pub min_lead_share: f64,
    pub min_near_lead: f64,
    pub min_near_explained: f64,
    pub min_turned_explained: f64,
    pub min_near_told: f64,
    pub min_finds: u32,
    pub again_m: f64,
    pub trial_m: f64,
    pub near_trial_m: f64,
    pub near_trial_explained: f64,
    pub near_trial_told: f64,
    pub trial_explained: f64,
    pub trial_told: f64,
    pub same_m: f64,
    pub same_rad: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            rays: [0.0, -1.0, 1.0, -0.5, 0.5],
            min_spread_rad: 0.05,
            silent_margin_m: 0.25,
            near_m: 0.12,
            through_m: 0.2,
            around_m: 0.1,
            start_m: 0.05,
            occupied: 100,
            solid: 200,
            free: -50,
            min_cos_incidence: 0.866,
            weights: [-1.4, 0.0, 1.8, 2.0, 3.0, 4.0, 2.1],
            independent_m: 0.3,
            turn_m_per_rad: 0.15,
            max_step_m: 0.1,
            max_beams: 8,
            leak_per_m: 1.0,
            jump_m: 0.3,
            jump_heard_m: 2.0,
            jump_way_m: 0.05,
            jump_turn_rad: degrees(3.0),
            jump_beams: 6,
            jump_share: 0.8,
            still_m: 0.005,
            still_rad: degrees(0.3),
            still_beams: 4,
            still_share: 0.5,
            jump_sigmas: 8.0,
            shift_m: 0.08,
            shift_sigmas: 5.0,
            shift_sweeps: 3,
            shift_beams: 3,
            shift_share: 0.4,
            suspect: 1.5,
            contradicted: 3.0,
            lost: 7.0,
            search: SearchParams::default(),
        }
    }
}

impl Default for SearchParams {
    fn default() -> Self {
        Self {
            trail_m: 2.5,
            spacing_m: 0.04,
            first_m: 0.4,
            every_m: 0.3,
            scanned: 64,
            per_sweep: 3000,
            pitch_m: 0.1,
            near_m: 0.75,
            near_until_m: 12.0,
            near_rad: degrees(12.0),
            turned_rad: degrees(100.0),
            turned_penalty: 4.0,
            carried_penalty: 5.0,
            near_step_rad: degrees(3.0),
            candidates: 24,
            apart_m: 0.5,
            apart_rad: degrees(20.0),
            min_explained: 0.86,
            rival_explained: 0.6,
            min_told: 0.6,
            min_lead: 6.0,
            min_lead_share: 0.38,
            min_near_lead: 3.0,
            min_near_explained: 0.65,
            min_turned_explained: 0.75,
            min_near_told: 0.3,
            min_finds: 2,
            again_m: 0.5,
            trial_m: 2.5,
            near_trial_m: 0.7,
            near_trial_explained: 0.72,
            near_trial_told: 0.25,
            trial_explained: 0.75,
            trial_told: 0.4,
            same_m: 0.3,
            same_rad: degrees(10.0),
        }
    }
}
