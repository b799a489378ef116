//! How a run ended, in words: why nothing was mapped, or what of the map is doubtful, and the last line for people.

use super::map_file::OCCUPIED_PERCENT;
use super::{FinalState, Summary};
use slamd_core::{Raster, SensorState, Waiting};
use std::fmt::Write as _;

/// A robot that has rolled less has not moved: an encoder may tremble by a tick. Metres.
const STANDSTILL_M: f64 = 0.02;
/// Lost sweeps are doubtful from this share on.
const MANY_DROPPED: f64 = 0.05;

/// A position that was known less exactly at any time is doubtful, metres: a map is read to half a door.
const DOUBTFUL_WITHIN_M: f64 = 0.5;

/// A learnt wheel base is told if it differs by this share from the configured one, and its standard deviation is below that share.
const MIN_BASE_ERROR: f64 = 0.08;
const MAX_BASE_SIGMA: f64 = 0.02;

/// Why a run has no map; none if it has one. The first reason on the way from the bytes to the map that applies.
pub(super) fn nothing_mapped(state: &FinalState<'_>, summary: &Summary) -> Option<String> {
    let (counters, max_range_m) = (state.counters, state.config.ring.max_range_m);
    if counters.frames == 0 {
        return Some(match counters.dropped_bytes {
            0 => "no frames: the board has sent nothing".into(),
            bytes => format!(
                "no frames: {bytes} bytes came, but none is part of a frame; check the baud rate and the board's firmware"
            ),
        });
    }
    if state.ring.is_empty() {
        return Some("no ring: the board has not described its sensors, and the configuration has no [ring.circle] or [ring.sensors]".into());
    }
    if counters.groups == 0 {
        return Some("no readings: the board has sent frames, but no SONAR frame that can be used".into());
    }
    if counters.sweeps == 0 {
        return Some(format!(
            "no sweeps: {} were dropped because too much of them was missing",
            counters.dropped_sweeps
        ));
    }
    if has_marks(state.raster) {
        return None;
    }
    if let Some(fault) = summary.encoder_faults.iter().find(|fault| fault.state == "dead") {
        return Some(format!("no movement is known: {}", fault.reason));
    }
    if !state.states.is_empty() && ignored(state.states).len() == state.states.len() {
        return Some(format!("no sensor is left: all {} are ignored, and faults.csv says why", state.states.len()));
    }
    Some(match state.waiting {
        Some(Waiting { rolled_m, .. }) if rolled_m < STANDSTILL_M => {
            "waiting for movement: the robot has not moved; drive it, and check the encoders if it was driven".into()
        }
        Some(Waiting { returns: 0, .. }) => {
            format!("too few walls: no sensor has measured a range within ring.max_range_m = {max_range_m}")
        }
        Some(Waiting { rolled_m, .. }) => format!(
            "no axis: the echoes of {rolled_m:.1} m of driving agree on no direction of walls; drive farther, along the walls"
        ),
        None => format!(
            "too few walls: no echo came often enough from one place to be drawn; ring.max_range_m is {max_range_m}"
        ),
    })
}

/// True if the map shows anything that returned the sound.
pub(super) fn has_marks(raster: &Raster) -> bool {
    raster.occupancy.iter().any(|percent| *percent >= OCCUPIED_PERCENT)
}

/// What of a run is doubtful, one sentence each; empty if nothing is.
pub(super) fn doubts(state: &FinalState<'_>, summary: &Summary, lost_since_s: Option<f64>) -> Vec<String> {
    let mut doubts = Vec::new();
    let Summary { uncertain_s, lock_losses, .. } = *summary;
    match lost_since_s {
        Some(since_s) => doubts
            .push(format!("the position is uncertain since {since_s:.1} s, to the end ({uncertain_s:.1} s in all)")),
        None if uncertain_s > 0.0 && lock_losses == 0 => {
            doubts.push(format!("the position was uncertain for {uncertain_s:.1} s"));
        }
        None if uncertain_s > 0.0 => {
            doubts.push(format!("the position was lost {} and uncertain for {uncertain_s:.1} s", times(lock_losses)));
        }
        None => {}
    }
    if let Some([last_m, worst_m]) = summary.position_within_m.filter(|[_, worst_m]| *worst_m > DOUBTFUL_WITHIN_M) {
        let [last_cm, worst_cm] = [last_m, worst_m].map(|m| 100.0 * m);
        doubts.push(format!(
            "the position was known to within {worst_cm:.0} cm only at worst, {last_cm:.0} cm at the end (95 %)"
        ));
    }
    if let Some(position) = summary.position.as_ref().filter(|position| !position.is_known) {
        doubts.push(position.reason.clone());
    }
    doubts.extend(summary.model.iter().filter(|report| !report.resolved).map(|report| report.text.clone()));
    doubts.extend(learnt_base(state, summary));
    doubts.extend(
        summary.encoder_faults.iter().map(|fault| {
            format!("the {} wheel's encoder is {} since {:.1} s", fault.wheel, fault.state, fault.found_s)
        }),
    );
    if summary.nothing_mapped.is_none() && summary.position.is_none() && state.walls == 0 {
        doubts.push("no straight wall was found: the poses are those of the encoders".into());
    }
    let (dropped, all) = (summary.dropped, summary.dropped + summary.sweeps);
    if dropped as f64 > MANY_DROPPED * all as f64 {
        doubts.push(format!("{dropped} of {all} sweeps were dropped: too much of them was missing"));
    }
    doubts
}

/// The wheel base that the run learnt, if it is another than configured and was not named before.
fn learnt_base(state: &FinalState<'_>, summary: &Summary) -> Option<String> {
    let (learnt, configured_m) = (state.calibration?, state.config.robot.wheel_base_m);
    let off = libm::log(learnt.wheel_base_m / configured_m).abs();
    let is_known = learnt.wheel_base_sigma_m < MAX_BASE_SIGMA * learnt.wheel_base_m;
    let is_named = summary.model.iter().any(|report| matches!(report.name, "turn_scale" | "turn_sign"));
    (off > MIN_BASE_ERROR && is_known && !is_named).then(|| {
        let base_m = learnt.wheel_base_m;
        format!("the wheels are {base_m:.3} m apart, not {configured_m:.3} m: robot.wheel_base_m = {base_m:.3}?; corrected for this run")
    })
}

/// The sensors that were ignored at the end, by id.
pub(super) fn ignored(states: &[SensorState]) -> Vec<usize> {
    let faulty = states.iter().enumerate().filter(|(_, state)| **state != SensorState::Healthy);
    faulty.map(|(sensor, _)| sensor).collect()
}

impl Summary {
    /// The last line for people: area, way, time, ignored sensors, doubts; or why nothing was mapped.
    #[must_use]
    pub fn last_line(&self) -> String {
        let Self { map_m2, path_m, duration_s, .. } = self;
        if let Some(reason) = &self.nothing_mapped {
            return format!("nothing mapped in {duration_s:.1} s: {reason}");
        }
        let floor_m2: f64 = self.rooms_m2.iter().sum();
        let area = match self.rooms_m2.len() {
            0 => format!("{map_m2:.1} m2, no room closed by walls,"),
            count => {
                let rooms = if count == 1 { "1 room".into() } else { format!("{count} rooms") };
                format!(
                    "{floor_m2:.1} m2 of floor in {rooms} ({map_m2:.1} m2 with walls, furniture and what was seen from afar)"
                )
            }
        };
        let mut line = format!("mapped {area} on {path_m:.1} m of way in {duration_s:.1} s; ");
        // Writing to a string cannot fail.
        let _ = match self.ignored_sensors.as_slice() {
            [] => write!(line, "no sensor ignored"),
            [one] => write!(line, "sensor {one} ignored"),
            many => {
                write!(line, "sensors {} ignored", many.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
            }
        };
        let _ = match self.doubtful.as_slice() {
            [] => write!(line, "; nothing doubtful"),
            doubts => write!(line, "; doubtful: {}", doubts.join("; ")),
        };
        line
    }
}

fn times(count: u64) -> String {
    if count == 1 { "once".into() } else { format!("{count} times") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{Config, Counters, Ring, Timestamp};

    /// The reason that a run without a wall gets.
    fn reason(counters: Counters, sensors: u8, waiting: Option<Waiting>) -> String {
        let (config, raster) = (Config::default(), Raster::default());
        let ring = if sensors == 0 { Ring::default() } else { Ring::circle(sensors, 0.15, 0.2, 1) };
        let state = FinalState {
            config: &config,
            raster: &raster,
            ring: &ring,
            states: &[],
            counters,
            calibration: None,
            walls: 0,
            waiting,
            ended: Timestamp::default(),
        };
        nothing_mapped(&state, &Summary::new(counters)).unwrap()
    }

    #[test]
    fn the_first_thing_that_is_missing_is_the_reason() {
        let none = Counters::default();
        let frames = Counters { frames: 3, ..none };
        let groups = Counters { groups: 3, ..frames };
        let sweeps = Counters { sweeps: 300, ..groups };
        assert!(reason(none, 8, None).contains("has sent nothing"));
        assert!(reason(Counters { dropped_bytes: 77, ..none }, 8, None).contains("77 bytes came"));
        assert!(reason(frames, 0, None).starts_with("no ring"));
        assert!(reason(frames, 8, None).starts_with("no readings"));
        assert!(reason(Counters { dropped_sweeps: 9, ..groups }, 8, None).contains("9 were dropped"));
        let waiting = |rolled_m, returns| reason(sweeps, 8, Some(Waiting { rolled_m, returns }));
        assert!(waiting(0.0, 200).contains("waiting for movement: the robot has not moved"));
        assert!(waiting(2.0, 0).starts_with("too few walls"));
        assert!(waiting(2.0, 200).starts_with("no axis"));
        assert!(reason(sweeps, 8, None).starts_with("too few walls"));
    }

    #[test]
    fn the_last_line_says_what_was_ignored_and_what_is_doubtful() {
        let mut summary = Summary::new(Counters::default());
        (summary.map_m2, summary.path_m, summary.duration_s) = (19.66, 20.04, 179.5);
        assert_eq!(
            summary.last_line(),
            "mapped 19.7 m2, no room closed by walls, on 20.0 m of way in 179.5 s; no sensor ignored; nothing doubtful"
        );
        summary.rooms_m2 = vec![10.0, 4.96];
        let line = summary.last_line();
        assert!(line.starts_with("mapped 15.0 m2 of floor in 2 rooms (19.7 m2 with walls, "), "{line}");
        summary.ignored_sensors = vec![3, 7];
        summary.doubtful = vec!["a".into(), "b".into()];
        assert!(summary.last_line().ends_with("; sensors 3, 7 ignored; doubtful: a; b"), "{}", summary.last_line());
        summary.nothing_mapped = Some("no axis".into());
        assert_eq!(summary.last_line(), "nothing mapped in 179.5 s: no axis");
    }
}
