//! `slamd simulate`

use super::outputs::{ForceArg, is_same_drive};
use super::{Failure, Kind, terminal};
use crate::source::pty;
use clap::{ArgGroup, Args};
use slamd_capture::{CaptureInfo, CaptureWriter};
use slamd_core::{Config, Record};
use slamd_sim::encoder::EncoderFault;
use slamd_sim::fault::{FaultMix, SensorFault};
use slamd_sim::link::LinkFaults;
use slamd_sim::robot_fault::RobotFault;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// With fewer sensors a warning is given.
const FEW_SENSORS: u8 = 4;
/// Sensors of the usual ring.
const SENSORS: u8 = 32;
/// Usual rate error of the board's clock, parts per million.
const DRIFT_PPM: f64 = 300.0;

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("to").required(true).args(["capture", "pty"])))]
pub(super) struct SimulateArgs {
    /// A built-in world (flat, office, furnished, home, room), random (each seed another home) or a TOML file.
    #[arg(long, default_value = "flat")]
    world: String,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the session.
    #[arg(long, value_name = "SECONDS", default_value = "300", value_parser = super::seconds)]
    duration: f64,
    /// A set of sensor faults: none, paper or late (each kind, from 60 s on).
    #[arg(long, default_value = "none")]
    faults: FaultMix,
    /// A sensor fault; kinds are saturated, missing, noisy and stuck.
    #[arg(long = "fault", value_name = "SENSOR:KIND@TIME[-TIME]")]
    fault: Vec<SensorFault>,
    /// A wheel encoder's fault: left or right, dead or reversed.
    #[arg(long, value_name = "WHEEL:KIND@TIME[-TIME]")]
    encoder_fault: Vec<EncoderFault>,
    /// A difference between the robot and its configuration, or hands that move it; give it several times for several.
    ///
    /// wheel-radius=FACTOR, ticks=FACTOR, base=FACTOR: true over configured value; wheels-swapped, wheels-reversed;
    /// ring-mirrored: numbered clockwise; ring-rotated=DEGREES; range-unit=FACTOR|one-way|cm: reported over true range;
    /// range-noise=METRES; kidnap[=lifted]@TIME: carried elsewhere; push=METRES@TIME: sideways;
    /// spin[=left|right|both]@TIME[-TIME]: wheels turn in place. For example base=1.6, kidnap@60s, push=0.3@45s.
    #[arg(long, value_name = "KIND[=VALUE][@TIME[-TIME]]")]
    robot_fault: Vec<RobotFault>,
    /// Shape of the beams: cone or point.
    #[arg(long, default_value = "cone")]
    beam: BeamShape,
    /// Number of sensors.
    #[arg(long, default_value_t = SENSORS, value_parser = clap::value_parser!(u8).range(1..=64))]
    sensors: u8,
    /// Scale of the odometry errors; 0 is perfect odometry.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    odometry_errors: f64,
    /// Standard deviation of the random range biases of the sensors.
    #[arg(long, value_name = "METRES", default_value = "0", value_parser = super::spread)]
    range_bias: f64,
    /// Standard deviation of the random bearing offsets of the sensors.
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = super::spread)]
    bearing_offset: f64,
    /// Rate error of the board's clock, parts per million.
    #[arg(long, value_name = "PPM", default_value_t = DRIFT_PPM)]
    clock_drift: f64,
    /// Probability that a byte on the link has a flipped bit.
    #[arg(long, value_name = "P", default_value = "0", value_parser = super::probability)]
    bit_errors: f64,
    /// Probability that a byte on the link is lost.
    #[arg(long, value_name = "P", default_value = "0", value_parser = super::probability)]
    byte_drops: f64,
    /// Probability that a random byte is inserted.
    #[arg(long, value_name = "P", default_value = "0", value_parser = super::probability)]
    byte_insertions: f64,
    /// Write the session with the true poses to this capture; without it, --pty is needed. An existing file is replaced only if it is the same simulated drive, or with --force.
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
    /// Simulate a board in real time on a pseudo-terminal of this name; without it, --capture is needed. The board obeys DRIVE: from the first one on the robot moves only as
    /// the host commands.
    #[arg(long, value_name = "NAME")]
    pty: Option<PathBuf>,
    /// The robot stands from the beginning until the host drives it.
    #[arg(long, requires = "pty")]
    stand: bool,
}

impl SimulateArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        if let Some(fault) = self.fault.iter().find(|fault| fault.sensor >= self.sensors) {
            let text = format!(
                "there is no sensor {}: with --sensors {} they are 0 to {}",
                fault.sensor,
                self.sensors,
                self.sensors - 1
            );
            return Err(Failure::new(Kind::Usage, text));
        }
        if self.sensors < FEW_SENSORS {
            tracing::warn!("--sensors {}: too few to localize a robot; a ring has {FEW_SENSORS} to 64", self.sensors);
        }
        let simulation = Simulation::new(SimConfig {
            world: world(&self.world, self.seed)?,
            seed: self.seed,
            duration_s: self.duration,
            mix: self.faults,
            faults: self.fault.clone(),
            beam: self.beam,
            sensors: self.sensors,
            odometry_errors: self.odometry_errors,
            clock_drift_ppm: self.clock_drift,
            link: LinkFaults { bit_flips: self.bit_errors, drops: self.byte_drops, insertions: self.byte_insertions },
        })
        .with_misfits(self.range_bias, self.bearing_offset.to_radians())
        .with_encoder_faults(self.encoder_fault.clone())
        .with_robot_faults(&self.robot_fault);
        let simulation = if self.stand { simulation.driven_by_host() } else { simulation };
        match (&self.capture, &self.pty) {
            (Some(path), _) => self.write(simulation, path),
            (None, Some(name)) => pty::serve(simulation, name)
                .map_err(|error| Failure::new(Kind::Unavailable, format!("{}: {error}", name.display()))),
            (None, None) => Err(Failure::new(Kind::Usage, "give --capture FILE or --pty NAME")),
        }
    }

    /// The command that makes this drive again. Sensor faults are listed beside it, in the capture's `faults`.
    fn description(&self) -> String {
        let Self { world, seed, duration, range_bias, bearing_offset, .. } = self;
        let mut text = format!(
            "slamd simulate --world {world} --seed {seed} --duration {duration} --range-bias {range_bias} --bearing-offset {bearing_offset}"
        );
        let link = [
            ("bit-errors", self.bit_errors),
            ("byte-drops", self.byte_drops),
            ("byte-insertions", self.byte_insertions),
        ];
        text += &unless(self.beam == BeamShape::default(), "beam", self.beam.word());
        text += &unless(self.sensors == SENSORS, "sensors", self.sensors);
        text += &unless(self.odometry_errors.to_bits() == 1.0_f64.to_bits(), "odometry-errors", self.odometry_errors);
        text += &unless(self.clock_drift.to_bits() == DRIFT_PPM.to_bits(), "clock-drift", self.clock_drift);
        text.extend(link.iter().map(|(option, value)| unless(value.to_bits() == 0, option, value)));
        text.extend(self.encoder_fault.iter().map(|fault| format!(" --encoder-fault {fault}")));
        text.extend(self.robot_fault.iter().map(|fault| format!(" --robot-fault {fault}")));
        text
    }

    fn write(&self, simulation: Simulation, path: &Path) -> Result<(), Failure> {
        let mut guard = self.force.guard().reads_all(Some(Path::new(&self.world)).filter(|world| world.is_file()));
        let info = CaptureInfo {
            slamd_version: env!("CARGO_PKG_VERSION").into(),
            protocol_version: format!("{}.{}", slamd_protocol::VERSION_MAJOR, slamd_protocol::VERSION_MINOR),
            config_toml: Config::default().to_toml(),
            unix_zero_us: None,
            notes: self.description(),
            faults: Some(simulation.faults().iter().map(ToString::to_string).collect()),
        };
        let output = guard.output_replacing(path, |there| is_same_drive(there, &info))?;
        let mut capture = CaptureWriter::output(output, &info).map_err(Failure::creating)?;
        let bar = terminal::progress(Some(self.duration));
        let (mut way_m, mut before) = (0.0, None);
        for record in session(simulation) {
            terminal::show(&bar, record.at().seconds());
            capture.record(&record).map_err(Failure::creating)?;
            if let Record::Truth { pose, .. } = &record {
                let at = pose.position();
                way_m += before.replace(at).map_or(0.0, |before| (at - before).norm());
            }
        }
        bar.finish_and_clear();
        capture.finish().map_err(Failure::creating)?;
        terminal::say(path.display());
        if way_m < STANDSTILL_M {
            tracing::warn!(
                "the robot has not moved in {} s: nothing can be mapped; choose a longer --duration",
                self.duration
            );
        } else {
            tracing::info!("{way_m:.1} m of way in {} s", self.duration);
        }
        Ok(())
    }
}

/// An option that the description names only where it is not the default.
fn unless(is_default: bool, option: &str, value: impl Display) -> String {
    if is_default { String::new() } else { format!(" --{option} {value}") }
}

/// A way that is none, metres.
const STANDSTILL_M: f64 = 0.02;

/// Loads a built-in world or a world file.
fn world(name: &str, seed: u64) -> Result<World, Failure> {
    if let Some(world) = World::for_seed(name, seed) {
        return Ok(world);
    }
    let path = Path::new(name);
    if path.extension().is_none_or(|extension| extension != "toml") {
        let known = World::BUILT_IN.join(", ");
        return Err(Failure::new(
            Kind::Usage,
            format!("there is no world \"{name}\"; there are {known}, {}, and files FILE.toml", World::RANDOM),
        ));
    }
    let text = slamd_files::regular::read_text(path, World::MAX_FILE_BYTES)
        .map_err(|error| Failure::new(Kind::NoInput, format!("{name}: {error}; name an existing world file")))?;
    World::from_toml(name, &text).map_err(|error| Failure::new(Kind::Config, error.to_string()))
}
