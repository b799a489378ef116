//! Everything outside the program: the robot and its board, the cable, the host's clock and scheduler, the disk; and what goes wrong with them.

use super::cable::{BAUD, Cable};
use super::ledger::Ledger;
use super::met::Met;
use super::plan::{Happening, Plan, SECOND_US, Sleep};
use crate::faulty_disk::FaultyDisk;
use slamd_capture::Record;
use slamd_core::{Pose2, Timestamp};
use slamd_sim::link::LinkFaults;
use slamd_sim::random::{Random, Stream};
use slamd_sim::simulation::{SimConfig, Simulation};
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World as Building;
use std::collections::VecDeque;
use std::time::Duration;

pub struct World {
    /// True time since the run began, microseconds.
    pub t_us: u64,
    /// How much the host's clock is ahead of it.
    ahead_us: u64,
    pub robot: Simulation,
    pub cable: Cable,
    pub ledger: Ledger,
    pub disk: FaultyDisk,
    pub random: Random,
    happenings: VecDeque<(u64, Happening)>,
    stalled_until: u64,
    /// The program has been killed; with the power cut or not.
    pub died: Option<bool>,
    /// The end of the last trouble.
    pub calm_since_us: u64,
    /// Where the robot truly was, by the host's clock.
    pub truths: Vec<(u64, Pose2)>,
    pub met: Met,
}

impl World {
    pub fn new(seed: u64, plan: &Plan) -> Self {
        let robot = Simulation::new(SimConfig {
            world: Building::named(plan.world).expect("built in"),
            seed,
            duration_s: 1e6,
            mix: plan.mix,
            faults: Vec::new(),
            beam: BeamShape::Cone,
            sensors: plan.sensors,
            odometry_errors: 1.0,
            clock_drift_ppm: plan.drift_ppm,
            // The cable does all damage: so it is known which bytes were sent.
            link: LinkFaults::default(),
        });
        let random = Random::new(!seed, Stream::Board);
        Self {
            t_us: 0,
            ahead_us: SECOND_US,
            robot,
            cable: Cable::new(Random::new(!seed, Stream::Link), plan.kernel_bytes),
            ledger: Ledger::default(),
            disk: FaultyDisk::default(),
            random,
            happenings: plan.happenings.iter().copied().collect(),
            stalled_until: 0,
            died: None,
            calm_since_us: 0,
            truths: Vec::new(),
            met: Met::default(),
        }
    }

    /// The host's clock, which counts from anywhere.
    pub fn host_us(&self) -> u64 {
        self.t_us + self.ahead_us
    }

    pub fn is_stalled(&self) -> bool {
        self.t_us < self.stalled_until
    }

    /// The program writes bytes to the port.
    pub fn write(&mut self, bytes: &[u8]) {
        let heard = self.cable.down(self.t_us, bytes);
        self.robot.hear(Timestamp::from_us(self.t_us), &heard);
    }

    /// Time goes on.
    pub fn advance(&mut self, us: u64) {
        let until_us = self.t_us + us;
        while let Some((at, happening)) = self.happenings.pop_front_if(|(at, _)| *at <= until_us) {
            self.run(at.max(self.t_us));
            self.happen(happening);
        }
        self.run(until_us);
    }

    fn run(&mut self, until_us: u64) {
        self.t_us = until_us;
        while let Some(record) = self.robot.poll(Timestamp::from_us(until_us)) {
            match record {
                Record::Truth { at, pose } => self.truths.push((at.us() + self.ahead_us, pose)),
                Record::Received { at, bytes } => {
                    self.ledger.sent(&bytes);
                    self.cable.up(at.us(), &bytes);
                }
                Record::Sent { .. } | Record::Opened { .. } => {}
            }
        }
    }

    fn happen(&mut self, happening: Happening) {
        let t_us = self.t_us;
        if !matches!(happening, Happening::Disk(_)) {
            self.calm_since_us = self.calm_since_us.max(t_us + happening.lasts_us());
        }
        match happening {
            Happening::Noise(faults, us) => self.cable.noise(faults, t_us + us),
            Happening::Burst(count) => self.cable.burst(count),
            Happening::Dead(us) => {
                self.met.silences += 1;
                self.cable.dead(t_us + us);
            }
            Happening::Unplug { for_us, loses_supply, busy_us } => {
                self.met.hang_ups += 1;
                self.cable.unplugged(t_us + for_us, t_us + for_us + busy_us);
                if loses_supply {
                    self.reset();
                }
            }
            Happening::Clogged(us) => self.cable.clogged(t_us + us),
            Happening::Reset => self.reset(),
            Happening::Stall(us) => {
                self.met.stalls += 1;
                self.stalled_until = self.stalled_until.max(t_us + us);
            }
            Happening::Suspend(us, sleep) => {
                self.met.sleeps += 1;
                if sleep != Sleep::Board {
                    self.ahead_us += us;
                }
                match sleep {
                    Sleep::All | Sleep::Board => self.robot.pass(Duration::from_micros(us)),
                    Sleep::HostClock => self.reset(),
                }
            }
            Happening::Disk(mode) => {
                self.met.disk_modes += 1;
                self.disk.set_mode(mode);
            }
            Happening::Death { power_cut } => {
                self.met.deaths += 1;
                self.died = Some(power_cut);
            }
        }
    }

    fn reset(&mut self) {
        self.met.resets += 1;
        self.robot.restart_board();
    }

    /// The port is there and nobody else has it.
    pub fn open(&mut self, baud: u32) -> bool {
        let is_free = self.cable.is_free(self.t_us);
        if is_free {
            self.cable.open(baud);
        }
        is_free
    }

    /// The rate a program sets first.
    pub const BAUD: u32 = BAUD;
}
