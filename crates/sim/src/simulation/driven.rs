//! The robot moves as the host commands, against what stands in its way.

use super::{Grip, Simulation, Timestamp};
use slamd_core::Pose2;

impl Simulation {
    /// The same session with a robot that stands until the host drives it.
    #[must_use]
    pub fn driven_by_host(mut self) -> Self {
        self.is_host_driven = true;
        self
    }

    /// The robot's true pose.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        self.robot.pose(0.0)
    }

    /// Metres from the robot's middle to the nearest surface, door leaf or person.
    #[must_use]
    pub fn clearance_m(&self) -> f64 {
        self.world.clearance(self.pose().position())
    }

    /// The wheels' speeds, left and right, metres per second.
    #[must_use]
    pub fn wheel_speeds_m_s(&self) -> [f64; 2] {
        self.robot.speeds_m_s()
    }

    /// Moves the robot: by its own driver, or by its motors from the host's first DRIVE on.
    pub(super) fn drive(&mut self, at: Timestamp, grip: Grip) {
        if let Some(frame) = self.board.control(at, self.robot.speeds_m_s()) {
            self.link.send(at, &frame);
        }
        self.is_host_driven |= self.board.motors().are_known();
        if self.is_host_driven {
            let grip = if self.robot.presses(&self.world) { Grip { forward: 0.0, ..grip } } else { grip };
            self.robot.step_driven(self.board.motors().drives(), grip);
        } else {
            self.robot.step_on(self.command, grip);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::FaultMix;
    use crate::link::LinkFaults;
    use crate::robot::BODY_RADIUS_M;
    use crate::simulation::SimConfig;
    use crate::sonar::BeamShape;
    use crate::world::World;
    use slamd_core::Record;
    use slamd_protocol::{
        Drive, FrameDecoder, FrameEncoder, Message, MotionState, Setting, VERSION_MAJOR, VERSION_MINOR, WheelSpeeds,
    };

    /// A host that commands, and what the board tells of its motors.
    struct Host {
        simulation: Simulation,
        encoder: FrameEncoder,
        decoder: FrameDecoder,
        now: Timestamp,
        states: Vec<MotionState>,
    }

    impl Host {
        fn new(world: &str) -> Self {
            let simulation = Simulation::new(SimConfig {
                world: World::for_seed(world, 1).unwrap(),
                seed: 1,
                duration_s: 1e6,
                mix: FaultMix::None,
                faults: Vec::new(),
                beam: BeamShape::Cone,
                sensors: 16,
                odometry_errors: 1.0,
                clock_drift_ppm: 0.0,
                link: LinkFaults::default(),
            });
            let mut host = Self {
                simulation: simulation.driven_by_host(),
                encoder: FrameEncoder::default(),
                decoder: FrameDecoder::new(),
                now: Timestamp::default(),
                states: Vec::new(),
            };
            host.run(200);
            host.say(&Message::HelloRequest { major: VERSION_MAJOR, minor: VERSION_MINOR });
            host
        }

        fn say(&mut self, message: &Message) {
            let frame = self.encoder.encode(message);
            self.simulation.hear(self.now, &frame);
        }

        fn run(&mut self, ms: u64) {
            self.now = Timestamp::from_us(self.now.us() + 1_000 * ms);
            while let Some(record) = self.simulation.poll(self.now) {
                let Record::Received { bytes, .. } = record else { continue };
                for byte in bytes {
                    let Some(frame) = self.decoder.push(byte) else { continue };
                    if let Ok(Message::Motion(motion)) = Message::parse(frame.kind, frame.payload)
                        && self.states.last() != Some(&motion.state)
                    {
                        self.states.push(motion.state);
                    }
                }
            }
        }

        fn start(&mut self) {
            self.say(&Message::Start);
            self.run(300);
        }

        fn drive(&mut self, left_mm_s: i16, right_mm_s: i16, times: u32) {
            for _ in 0..times {
                let speeds = WheelSpeeds::new(left_mm_s, right_mm_s).unwrap();
                self.say(&Message::Drive(Drive::new(speeds, 300, Drive::FROM_SOCKET).unwrap()));
                self.run(100);
            }
        }

        fn stands(&self) -> bool {
            self.simulation.wheel_speeds_m_s().iter().all(|speed_m_s| speed_m_s.abs() < 1e-9)
        }
    }

    #[test]
    fn it_stands_until_it_is_driven_and_within_400_ms_of_the_last_word() {
        let mut host = Host::new("flat");
        host.start();
        host.run(5_000);
        assert!(host.stands() && host.states.is_empty());
        host.drive(200, -200, 10);
        let [left, right] = host.simulation.wheel_speeds_m_s();
        assert!((left - 0.2).abs() < 0.01 && (right + 0.2).abs() < 0.01, "{left} {right}");
        // The last word was 100 ms ago.
        host.run(300);
        assert!(host.stands(), "{:?}", host.simulation.wheel_speeds_m_s());
        assert!(host.states.ends_with(&[MotionState::Driving, MotionState::TimeOut]), "{:?}", host.states);
    }

    #[test]
    fn it_touches_nothing_while_its_sensors_look_and_slips_where_it_touches() {
        let mut host = Host::new("flat");
        host.start();
        host.drive(300, 300, 300);
        assert_eq!(host.states.last(), Some(&MotionState::Obstacle));
        let clearance = |host: &Host| host.simulation.world.clearance(host.simulation.pose().position());
        assert!(clearance(&host) > BODY_RADIUS_M + 0.1, "{} m", clearance(&host));
        // With the stop distance of 0 it creeps up to the wall, and no further.
        host.say(&Message::Stop);
        host.run(50);
        host.say(&Message::ConfigSet { key: Setting::StopDistanceMm.key(), value: 0 });
        host.start();
        host.drive(100, 100, 200);
        assert!(clearance(&host) > BODY_RADIUS_M - 0.01, "{} m", clearance(&host));
    }
}
