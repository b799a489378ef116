//! What a simulation is made of.

use crate::fault::{FaultMix, SensorFault};
use crate::link::LinkFaults;
use crate::sonar::BeamShape;
use crate::world::World;

/// What to simulate.
#[derive(Clone, Debug)]
pub struct SimConfig {
    /// The world.
    pub world: World,
    /// Seed of every random number.
    pub seed: u64,
    /// Length of the session, seconds.
    pub duration_s: f64,
    /// A named mix of sensor faults.
    pub mix: FaultMix,
    /// Further sensor faults.
    pub faults: Vec<SensorFault>,
    /// The beams' shape.
    pub beam: BeamShape,
    /// Sensors of the ring.
    pub sensors: u8,
    /// Scale of the odometry's errors: 0 is perfect, 1 usual.
    pub odometry_errors: f64,
    /// Error of the board's clock, parts per million.
    pub clock_drift_ppm: f64,
    /// Transmission errors of the serial line.
    pub link: LinkFaults,
}

impl SimConfig {
    /// A usual robot: cone beams, usual wheels, a clock that is 300 ppm off, a clean line, no fault.
    #[must_use]
    pub fn usual(world: World, seed: u64, duration_s: f64, sensors: u8) -> Self {
        Self {
            world,
            seed,
            duration_s,
            mix: FaultMix::None,
            faults: Vec::new(),
            beam: BeamShape::Cone,
            sensors,
            odometry_errors: 1.0,
            clock_drift_ppm: 300.0,
            link: LinkFaults::default(),
        }
    }
}
