//! The raw map: every reading where the encoders alone put it, as the paper's Figure 1.

use slamd_capture::Record;
use slamd_core::{
    Config, Point, Pose2, Ring, Sweep,
    stages::{Aligner, Wheels},
};
use slamd_protocol::{FrameDecoder, Message};
use slamd_sim::robot::TICKS_PER_TURN;
use std::f64::consts::TAU;

/// The endpoint of every reading, of broken sensors, too, in the frame of the first pose. A saturated reading ends at the farthest range.
#[must_use]
pub fn raw_map(records: &[Record], ring: &Ring) -> Vec<Point> {
    let config = Config::default();
    let (robot, limits) = (&config.robot, &config.ring);
    let mut aligner = Aligner::new(limits);
    aligner.set_ring(ring.clone());
    let metres_per_tick = [TAU * robot.wheel_radius_m / f64::from(TICKS_PER_TURN); 2];
    aligner.set_wheels(Wheels { metres_per_tick, base_m: robot.wheel_base_m });
    let (mut decoder, mut points, mut first) = (FrameDecoder::new(), Vec::new(), None);
    let mut add = |sweep: &Sweep| {
        let first: Pose2 = *first.get_or_insert(sweep.odometry);
        let pose = first.inverse() * sweep.odometry;
        for beam in &sweep.beams {
            let range_m = if beam.is_clear() { limits.max_range_m } else { beam.range_m };
            if range_m.is_finite() {
                points.push((pose * beam.robot_from_sensor).ahead(range_m));
            }
        }
    };
    for record in records {
        let Record::Received { at, bytes } = record else { continue };
        for &byte in bytes {
            let Some(frame) = decoder.push(byte) else { continue };
            // A simulated board does not restart.
            let _ = match Message::parse(frame.kind, frame.payload) {
                Ok(Message::Sonar(sonar)) => aligner.sonar(&sonar, *at, &mut add),
                Ok(Message::Encoder(encoder)) => aligner.encoder(&encoder, *at),
                _ => Ok(()),
            };
        }
    }
    points
}
