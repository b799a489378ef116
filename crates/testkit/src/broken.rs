//! A drive with broken sensors or encoders, beside the same drive with whole ones.

use slamd_capture::Record;
use slamd_core::{
    Config, EncoderEvent, Estimate, Event, FaultEvent, Input, LocalizationEvent, Output, Pose2, Timestamp,
};
use slamd_metrics::{Pair, Pairing, building_frame};
use slamd_protocol::{FrameDecoder, FrameEncoder, Message};
use slamd_sim::encoder::EncoderFault;
use slamd_sim::fault::SensorFault;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;

/// What is driven, and what breaks.
#[derive(Clone, Debug)]
pub struct Drive {
    pub world: &'static str,
    pub sensors: u8,
    pub seed: u64,
    pub seconds: f64,
    pub odometry_errors: f64,
    pub sensor_faults: Vec<SensorFault>,
    pub encoder_faults: Vec<EncoderFault>,
    /// Wheels that spin on the spot.
    pub slip: Option<Slip>,
}

/// Wheels that spin on the spot for half a second.
#[derive(Clone, Copy, Debug)]
pub struct Slip {
    pub at_s: f64,
    /// How far each rolls for nothing, left and right, metres.
    pub metres: [f64; 2],
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Root mean square error of the position, aligned with the truth at the first pose only, metres.
    pub ate_m: f64,
    /// Root mean square and greatest error of the position in the map frame as it is defined, along the building's walls, metres.
    pub rms_m: f64,
    pub worst_m: f64,
    pub sweeps: Vec<Told>,
    pub faults: Vec<FaultEvent>,
    pub encoders: Vec<EncoderEvent>,
    pub locks: Vec<LocalizationEvent>,
}

/// The error of a sweep's pose, and the uncertainty that was stated.
#[derive(Clone, Copy, Debug)]
pub struct Told {
    /// In the map frame as it is defined, which is what the pose and its covariance are of, metres.
    pub error_m: f64,
    /// Two standard deviations of the position, metres.
    pub two_sigma_m: f64,
    /// The pose was called uncertain.
    pub is_uncertain: bool,
}

/// Errors that a drive with broken sensors may have, as a ratio to the whole drive's.
pub const MAX_RATIO: f64 = 1.5;
/// Errors below these do not matter: of a sweep, and of a drive, which is the noise of one reading, metres.
pub const MIN_ERROR_M: f64 = 0.05;
pub const MIN_RMS_M: f64 = 0.02;

impl Drive {
    /// The flat with 32 sensors.
    pub fn flat(seed: u64, seconds: f64) -> Self {
        Self {
            world: "flat",
            sensors: 32,
            seed,
            seconds,
            odometry_errors: 1.0,
            sensor_faults: Vec::new(),
            encoder_faults: Vec::new(),
            slip: None,
        }
    }

    /// Drives and estimates.
    pub fn run(&self) -> Outcome {
        let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
        let (mut pairing, mut pairs) = (Pairing::<Estimate>::default(), Vec::new());
        let mut outcome = Outcome::default();
        let mut slipping = Slipping { decoder: FrameDecoder::new(), encoder: FrameEncoder::new() };
        for record in session(self.simulation()) {
            match self.slip.map_or_else(|| record.clone(), |slip| slipping.slipped(slip, record.clone())) {
                Record::Received { at, bytes } if !bytes.is_empty() => {
                    pipeline.handle(Input::Received { at, bytes: &bytes });
                }
                Record::Received { .. } | Record::Opened { .. } => {}
                Record::Sent { at, bytes } => pipeline.handle(Input::Sent { at, bytes: &bytes }),
                Record::Truth { at, pose } => pairing.truth(at, pose),
            }
            while let Some(output) = pipeline.poll_output() {
                match output {
                    Output::Event(Event::Estimate(estimate)) => pairing.estimate(estimate.at, estimate),
                    Output::Event(Event::Fault(fault)) => outcome.faults.push(fault),
                    Output::Event(Event::Encoder(encoder)) => outcome.encoders.push(encoder),
                    Output::Event(Event::Localization(lock)) => outcome.locks.push(lock),
                    _ => {}
                }
            }
            pairs.extend(std::iter::from_fn(|| pairing.next_pair()));
        }
        outcome.compare(&pairs);
        outcome
    }

    fn simulation(&self) -> Simulation {
        Simulation::new(SimConfig {
            faults: self.sensor_faults.clone(),
            odometry_errors: self.odometry_errors,
            ..SimConfig::usual(
                World::named(self.world).expect("a built-in world"),
                self.seed,
                self.seconds,
                self.sensors,
            )
        })
        .with_encoder_faults(self.encoder_faults.clone())
    }
}

impl Outcome {
    fn compare(&mut self, pairs: &[Pair<Estimate>]) {
        let Some(first) = pairs.first() else { return };
        let (from_first, from_building) = (first.truth * first.estimate.pose.inverse(), building_frame(first));
        let (mut ate_m2, mut rms_m2) = (0.0, 0.0);
        for pair in pairs {
            let off_m = |frame: Pose2| ((frame * pair.estimate.pose).position() - pair.truth.position()).norm();
            let error_m = off_m(from_building);
            let cov = pair.estimate.covariance;
            let (mean, half) = (0.5 * (cov[(0, 0)] + cov[(1, 1)]), 0.5 * (cov[(0, 0)] - cov[(1, 1)]));
            let greatest = mean + libm::hypot(half, cov[(0, 1)]);
            let (two_sigma_m, is_uncertain) = (2.0 * greatest.sqrt(), self.is_uncertain(pair.at));
            self.sweeps.push(Told { error_m, two_sigma_m, is_uncertain });
            ate_m2 += off_m(from_first).powi(2);
            rms_m2 += error_m * error_m;
            self.worst_m = self.worst_m.max(error_m);
        }
        self.ate_m = (ate_m2 / pairs.len() as f64).sqrt();
        self.rms_m = (rms_m2 / pairs.len() as f64).sqrt();
    }

    /// Whether the lock's events call the pose of that time uncertain.
    fn is_uncertain(&self, at: Timestamp) -> bool {
        let mut until = self.locks.iter().filter(|lock| !lock.is_lost());
        let ended = until.any(|lock| (lock.since..=lock.at).contains(&at));
        let open = self.locks.last().filter(|lock| lock.is_lost());
        ended || open.is_some_and(|lock| at >= lock.since)
    }

    /// Whether the drive is worse than the faults excuse.
    pub fn is_worse_than(&self, whole: &Self) -> bool {
        self.rms_m > MAX_RATIO * whole.rms_m && self.rms_m > MIN_RMS_M
    }

    /// Of the sweeps with errors above 1.5 times the whole drive's greatest error, the share whose stated uncertainty covers the
    /// error; none if there are no such sweeps.
    pub fn covered(&self, whole: &Self) -> Option<f64> {
        let limit_m = (MAX_RATIO * whole.worst_m).max(MIN_ERROR_M);
        let off: Vec<_> = self.sweeps.iter().filter(|told| told.error_m > limit_m).collect();
        let said = off.iter().filter(|told| told.is_uncertain || told.error_m <= told.two_sigma_m).count();
        (!off.is_empty()).then(|| said as f64 / off.len() as f64)
    }
}

/// Puts a slip into what the board says.
struct Slipping {
    decoder: FrameDecoder,
    encoder: FrameEncoder,
}

/// The default wheels: 2 pi 0.035 m in 1440 ticks.
const METRES_PER_TICK: f64 = 0.219_911_5 / 1440.0;

impl Slipping {
    fn slipped(&mut self, slip: Slip, record: Record) -> Record {
        let Record::Received { at, bytes } = record else { return record };
        let share = ((at.seconds() - slip.at_s) / 0.5).clamp(0.0, 1.0);
        #[expect(clippy::cast_possible_truncation, reason = "some thousand ticks")]
        let ticks = slip.metres.map(|metres| (share * metres / METRES_PER_TICK) as i32);
        let mut out = Vec::new();
        for byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            let mut message = Message::parse(frame.kind, frame.payload).expect("a whole line");
            if let Message::Encoder(encoder) = &mut message {
                (encoder.left_ticks, encoder.right_ticks) =
                    (encoder.left_ticks + ticks[0], encoder.right_ticks + ticks[1]);
            }
            if let Message::Sonar(sonar) = &mut message {
                (sonar.left_ticks, sonar.right_ticks) = (sonar.left_ticks + ticks[0], sonar.right_ticks + ticks[1]);
            }
            out.extend_from_slice(&self.encoder.encode(&message));
        }
        Record::Received { at, bytes: out }
    }
}
