//! A small copy of one sweep for display, made on the pipeline's thread.

use slamd_core::{Counters, Estimate, Pipeline, Pose2, Ring, Segment, SensorState, Timestamp, Verdict};
use std::sync::Arc;
use std::time::Duration;

/// One sweep with the estimates at its time.
#[derive(Clone, Debug)]
pub(super) struct Snapshot {
    /// The sweep's reference instant.
    pub(super) at: Timestamp,
    /// The sweep's number.
    pub(super) sweep: u64,
    /// The pose, once there is one.
    pub(super) estimate: Option<Estimate>,
    /// One beam per sensor, by id. Empty if only the pose is new.
    pub(super) beams: Vec<Beam>,
    /// The sensors' mountings.
    pub(super) ring: Arc<Ring>,
    /// True while the pose is lost.
    pub(super) is_lost: bool,
    /// The walls, if they are part of this snapshot.
    pub(super) segments: Option<Arc<[Segment]>>,
    /// The pipeline's counters.
    pub(super) counters: Counters,
    /// Time from the sweep's reference instant to this snapshot, session time.
    pub(super) latency: Duration,
    /// The pipeline's computing time for the sweep.
    pub(super) took: Duration,
}

/// One beam of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beam {
    /// The sensor at its ping, in the robot frame of the reference instant.
    pub(super) robot_from_sensor: Pose2,
    /// Half opening angle, radians.
    pub(super) half_angle_rad: f32,
    /// Range, metres, as in REP-117.
    pub(super) range_m: f32,
    /// How the estimator used the beam.
    pub(super) verdict: Verdict,
    /// The sensor's state.
    pub(super) state: SensorState,
    /// The evidence of a fault, which is declared above 6; NaN if the method has none.
    pub(super) score: f32,
    /// Square root of the PCA residual (MSPE), metres.
    pub(super) residual_m: f32,
}

impl Snapshot {
    /// The beams of the pipeline's newest sweep.
    #[expect(clippy::cast_possible_truncation, reason = "for display")]
    pub(super) fn beams(pipeline: &Pipeline) -> Vec<Beam> {
        let beams = pipeline.sweep().map_or(&[][..], |sweep| &sweep.beams);
        let states = pipeline.states();
        let beam = |(sensor, beam): (usize, &slamd_core::Beam)| {
            let (score, residual_m) = pipeline.fault_evidence(sensor);
            let verdict = pipeline.verdict(sensor);
            Beam {
                robot_from_sensor: beam.robot_from_sensor,
                half_angle_rad: beam.half_angle_rad as f32,
                range_m: beam.range_m as f32,
                verdict: if verdict == Verdict::Used && !beam.has_range() { Verdict::Silent } else { verdict },
                state: states.get(sensor).copied().unwrap_or_default(),
                score: score as f32,
                residual_m: residual_m as f32,
            }
        };
        beams.iter().enumerate().map(beam).collect()
    }
}
