//! One sweep as it is shown: a small copy, made on the pipeline's thread.

use slamd_core::event::{Counters, Estimate, SensorState, Verdict};
use slamd_core::geometry::{Pose2, Ring, Segment};
use slamd_core::pipeline::Pipeline;
use slamd_core::time::Timestamp;
use std::sync::Arc;
use std::time::Duration;

/// One sweep, and what is known by then.
#[derive(Clone, Debug)]
pub(super) struct Snapshot {
    /// The sweep's reference instant.
    pub(super) at: Timestamp,
    /// The sweep's number.
    pub(super) sweep: u64,
    /// The pose, once there is one.
    pub(super) estimate: Option<Estimate>,
    /// One per sensor, by id; none for a sweep of which only the pose is news.
    pub(super) beams: Vec<Beam>,
    /// The sensors' places.
    pub(super) ring: Arc<Ring>,
    /// True while the robot does not know where it is, having known it before.
    pub(super) is_lost: bool,
    /// The walls, where they have been looked at this time.
    pub(super) segments: Option<Arc<[Segment]>>,
    /// What has been counted.
    pub(super) counters: Counters,
    /// From the sweep's last ping to here, session time.
    pub(super) latency: Duration,
    /// What the pipeline took for it, processor and all.
    pub(super) took: Duration,
}

/// One beam of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beam {
    /// The sensor at its ping, in the robot frame of the reference instant.
    pub(super) robot_from_sensor: Pose2,
    /// Half its opening angle, radians.
    pub(super) half_angle_rad: f32,
    /// Metres, or as REP-117.
    pub(super) range_m: f32,
    /// What became of it.
    pub(super) verdict: Verdict,
    /// The sensor's state.
    pub(super) state: SensorState,
    /// The evidence that the sensor is broken; a fault is declared from 6 on, NaN where the method has none.
    pub(super) score: f32,
    /// Root of what PCA leaves unexplained, metres.
    pub(super) residual_m: f32,
}

impl Snapshot {
    /// The newest sweep of the pipeline.
    #[expect(clippy::cast_possible_truncation, reason = "to be looked at")]
    pub(super) fn beams(pipeline: &Pipeline) -> Vec<Beam> {
        let beams = pipeline.sweep().map_or(&[][..], |sweep| &sweep.beams);
        let states = pipeline.states();
        let beam = |(sensor, beam): (usize, &slamd_core::sweep::Beam)| {
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
