//! Pings → sweeps: gathers one cycle of the ring and moves each ping to the sweep's reference instant.
//!
//! The ring fires in groups, so one V\[k\] spans 100-200 ms, in which a robot drives 5-10 cm or turns 6-12 degrees. The reference
//! instant is the last ping's trigger. A beam is seen from where its sensor was when the sound turned back, half the time
//! of flight after the trigger; the odometry track tells where that was in the robot frame of the reference instant.

use super::params::Params;
use super::track::{Track, Travel, Wheels};
use crate::config::CorrectionConfig;
use crate::geometry::{Mounting, Placement, Pose2, Ring};
use crate::sweep::{Beam, NoMeasurement, Sweep};
use crate::time::{DeviceTime, Timestamp};
use slamd_protocol::{Echo, Sonar};

/// One sensor's answer in the current cycle.
#[derive(Clone, Copy, Debug)]
struct Ping {
    at: DeviceTime,
    echo: Option<Echo>,
}

/// One sensor with its calibration applied.
#[derive(Clone, Copy, Debug)]
struct Corrected {
    range_bias_m: f64,
    robot_from_sensor: Pose2,
}

impl Corrected {
    /// One per sensor. Sensors without a correction stay nominal; corrections outside the ring are ignored.
    fn ring(ring: &Ring, corrections: &[CorrectionConfig]) -> Vec<Self> {
        let nominal = |mounting: &Mounting| Self { range_bias_m: 0.0, robot_from_sensor: mounting.robot_from_sensor };
        let mut sensors: Vec<Self> = ring.mountings.iter().map(nominal).collect();
        for correction in corrections {
            if let Some(sensor) = sensors.get_mut(usize::from(correction.sensor)) {
                sensor.range_bias_m = correction.range_bias_m;
                sensor.robot_from_sensor =
                    sensor.robot_from_sensor * Pose2::new(0.0, 0.0, correction.bearing_offset_deg.to_radians());
            }
        }
        sensors
    }
}

/// Collects pings into sweeps.
#[derive(Clone, Debug)]
pub(crate) struct Sweeper {
    ring: Ring,
    corrected: Vec<Corrected>,
    range_m: std::ops::RangeInclusive<f64>,
    sound_m_s: f64,
    range_scale: f64,
    pings: Vec<Option<Ping>>,
    /// The groups of the current cycle, one bit each.
    groups: [u64; 4],
    newest: Option<DeviceTime>,
    previous: Option<(DeviceTime, Travel)>,
    sweep: Sweep,
    count: u64,
    dropped: u64,
    params: Params,
}

impl Sweeper {
    /// A sweeper for a ring whose sensors measure within `range_m`, with these calibration `corrections`.
    #[must_use]
    pub(crate) fn new(
        ring: Ring,
        corrections: &[CorrectionConfig],
        range_m: std::ops::RangeInclusive<f64>,
        temperature_c: f64,
        params: Params,
    ) -> Self {
        let corrected = Corrected::ring(&ring, corrections);
        let pings = vec![None; ring.len()];
        let sweep = Sweep { beams: Vec::with_capacity(ring.len()), ..Sweep::default() };
        let mut sweeper = Self {
            ring,
            corrected,
            range_m,
            sound_m_s: 0.0,
            range_scale: 1.0,
            pings,
            groups: [0; 4],
            newest: None,
            previous: None,
            sweep,
            count: 0,
            dropped: 0,
            params,
        };
        sweeper.set_temperature(temperature_c);
        sweeper
    }

    /// The ring.
    #[must_use]
    pub(crate) fn ring(&self) -> &Ring {
        &self.ring
    }

    /// The last finished sweep; it has no beams before the first.
    #[must_use]
    pub(crate) fn sweep(&self) -> &Sweep {
        &self.sweep
    }

    /// Sweeps dropped because too few of their messages arrived.
    #[must_use]
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Sets the air temperature T, degrees Celsius: the speed of sound is 331.3 + 0.606 T metres per second.
    pub(crate) fn set_temperature(&mut self, temperature_c: f64) {
        self.sound_m_s = 331.3 + 0.606 * temperature_c;
    }

    /// Sets the true over the reported range.
    pub(crate) fn scale_ranges(&mut self, range_scale: f64) {
        self.range_scale = range_scale;
    }

    /// True if the group already arrived in the current cycle: it then starts a new one.
    #[must_use]
    pub(crate) fn has_heard(&self, group: u8) -> bool {
        // A group that no sensor belongs to names its sensors one by one, and may come many times in a cycle.
        let is_of_ring = self.ring.mountings.iter().any(|mounting| mounting.group == group);
        is_of_ring && self.groups.get(usize::from(group / 64)).is_some_and(|groups| groups >> (group % 64) & 1 == 1)
    }

    /// Adds one fired group; `at` is its trigger. Sensors outside the ring are ignored, and flights that are no microseconds are too short.
    pub(crate) fn add(&mut self, sonar: &Sonar, at: DeviceTime, microseconds: impl Fn(u16) -> Option<u16>) {
        if let Some(groups) = self.groups.get_mut(usize::from(sonar.group / 64)) {
            *groups |= 1 << (sonar.group % 64);
        }
        for (mounting, ping) in self.ring.mountings.iter().zip(&mut self.pings) {
            if mounting.group == sonar.group {
                *ping = Some(Ping { at, echo: None });
            }
        }
        for answer in &sonar.echoes {
            if let Some(ping) = self.pings.get_mut(usize::from(answer.sensor)) {
                let echo = match answer.echo {
                    Echo::Flight { us } => Echo::Flight { us: microseconds(us).unwrap_or(0) },
                    other => other,
                };
                *ping = Some(Ping { at, echo: Some(echo) });
            }
        }
        self.newest = self.newest.max(Some(at));
    }

    /// The reference instant of the current cycle.
    #[must_use]
    pub(crate) fn reference(&self) -> Option<DeviceTime> {
        self.newest
    }

    /// Ends the current cycle. `at` is its reference instant by the host's clock. None if too few sensors answered.
    pub(crate) fn finish(&mut self, at: Timestamp, track: &Track, wheels: Wheels) -> Option<&Sweep> {
        let reference = self.newest.take()?;
        self.groups = [0; 4];
        let heard = self.pings.iter().flatten().count();
        if (heard as f64) < self.params.min_heard * self.pings.len() as f64 {
            self.dropped += 1;
            self.pings.fill(None);
            return None;
        }
        let (odometry, travel) = track.at(reference, wheels)?;
        let robot_from_odom = Placement::from(odometry.inverse());
        self.sweep.beams.clear();
        for ((mounting, sensor), ping) in self.ring.mountings.iter().zip(&self.corrected).zip(&mut self.pings) {
            let (range_m, no_measurement) =
                measured(*ping, self.range_scale * self.sound_m_s, sensor.range_bias_m, &self.range_m);
            let bounce = ping.map(|ping| ping.at + ping.half_flight());
            let then = bounce.and_then(|bounce| track.at(bounce, wheels)).map_or(odometry, |(pose, _)| pose);
            self.sweep.beams.push(Beam {
                range_m,
                no_measurement,
                age_s: ping.map_or(f64::NAN, |ping| reference.seconds_since(ping.at)),
                robot_from_sensor: robot_from_odom * then * sensor.robot_from_sensor,
                half_angle_rad: mounting.half_angle_rad,
            });
            *ping = None;
        }
        let (since, before) = self.previous.unwrap_or((reference, travel));
        self.previous = Some((reference, travel));
        self.sweep.index = self.count;
        self.count += 1;
        self.sweep.at = at;
        self.sweep.elapsed_s = reference.seconds_since(since);
        self.sweep.odometry = odometry;
        self.sweep.left_m = travel.left_m - before.left_m;
        self.sweep.right_m = travel.right_m - before.right_m;
        Some(&self.sweep)
    }

    /// The board restarted: the current cycle is lost, the travel continues.
    pub(crate) fn restart(&mut self) {
        self.pings.fill(None);
        self.groups = [0; 4];
        self.newest = None;
        self.previous = self.previous.map(|(_, travel)| (DeviceTime::default(), travel));
    }
}

impl Ping {
    /// From the trigger to the reflection.
    fn half_flight(&self) -> std::time::Duration {
        match self.echo {
            Some(Echo::Flight { us }) => std::time::Duration::from_micros(u64::from(us) / 2),
            _ => std::time::Duration::ZERO,
        }
    }
}

/// REP-117 range of one ping and, if it is NaN, the reason.
fn measured(
    ping: Option<Ping>,
    sound_m_s: f64,
    bias_m: f64,
    valid_m: &std::ops::RangeInclusive<f64>,
) -> (f64, Option<NoMeasurement>) {
    let none = |reason| (f64::NAN, Some(reason));
    match ping {
        None => none(NoMeasurement::Lost),
        Some(Ping { echo: None, .. }) => none(NoMeasurement::Absent),
        Some(Ping { echo: Some(echo), .. }) => match echo {
            Echo::Flight { us } => {
                let range_m = 0.5e-6 * f64::from(us) * sound_m_s - bias_m;
                if range_m < *valid_m.start() {
                    (f64::NEG_INFINITY, None)
                } else if range_m > *valid_m.end() {
                    (f64::INFINITY, None)
                } else {
                    (range_m, None)
                }
            }
            Echo::NoEcho => (f64::INFINITY, None),
            Echo::PinStuck => none(NoMeasurement::EchoPinStuck),
            Echo::HighAtTrigger => none(NoMeasurement::HighAtTrigger),
            Echo::Disabled => none(NoMeasurement::Disabled),
            Echo::Blanked => none(NoMeasurement::Blanked),
        },
    }
}
