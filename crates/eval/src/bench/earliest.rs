//! The earliest time at which a saturated sensor differs from a healthy one: when a healthy one at its mounting would have received an echo.

use super::case::Case;
use slamd_capture::Record;
use slamd_core::{FaultKind, Ring};
use slamd_metrics::TrueFault;
use slamd_sim::world::World;

/// Seconds from the begin of each fault until the first true pose from which a healthy sensor hears something; to the end of the drive
/// where there is none. Before it nothing that any method could look at differs.
#[must_use]
pub fn earliest_s(case: &Case, world: &World, records: &[Record], ring: &Ring, faults: &[TrueFault]) -> Vec<f64> {
    let saturated = faults.iter().filter(|fault| fault.kind == FaultKind::Saturated);
    let earliest_s = |fault: &TrueFault| {
        let mounting = ring.mountings.get(fault.sensor)?;
        let truths = records.iter().filter_map(|record| match record {
            Record::Truth { at, pose } if *at >= fault.from => Some((at, *pose)),
            _ => None,
        });
        let heard = |&(_, pose): &(_, _)| case.beam.distance(world, pose * mounting.robot_from_sensor).is_some();
        let last = truths.clone().next_back()?;
        let (at, _) = truths.clone().find(heard).unwrap_or(last);
        Some(at.seconds_since(fault.from))
    };
    saturated.filter_map(earliest_s).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{Point, Pose2, Timestamp};
    use slamd_sim::world::Segment;

    #[test]
    fn a_saturated_sensor_shows_when_the_robot_comes_near_a_wall_and_at_the_end_where_it_never_does() {
        let wall = Segment { from: Point::new(5.0, -9.0), to: Point::new(5.0, 9.0) };
        let world = World::new("test", vec![wall], Point::origin(), None);
        let truth = |t: u64| Record::Truth {
            at: Timestamp::from_us(t * 1_000_000),
            pose: Pose2::new(0.5 * t as f64, 0.0, 0.0),
        };
        let records: Vec<Record> = (0..=9).map(truth).collect();
        let ring = Ring::circle(8, 0.15, 0.2, 4);
        let faults: Vec<TrueFault> =
            ["0:saturated@1s", "4:saturated@1s", "1:noisy@1s"].map(|t| t.parse().unwrap()).into();
        // The front sensor is within 3 m of the wall from x = 1.85 m on.
        assert_eq!(earliest_s(&Case::usual(), &world, &records, &ring, &faults), [3.0, 8.0]);
    }
}
