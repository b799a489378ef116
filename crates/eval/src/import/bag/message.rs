//! The messages of a bag that an import reads.

use super::cdr::Cdr;
use slamd_core::Pose2;

/// What a message says, with the stamp of its header in seconds; 0 if nobody has set it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Message {
    /// `sensor_msgs/Range`: metres, infinity for nothing in range, NaN for no measurement, and 0 for too close.
    Range { frame: String, range_m: f64 },
    /// `sensor_msgs/LaserScan`.
    Scan { first_rad: f64, step_rad: f64, ranges_m: Vec<f64> },
    /// `nav_msgs/Odometry`.
    Odometry(Pose2),
    /// `sensor_msgs/JointState`: angles of named wheels, radians.
    Joints(Vec<(String, f64)>),
    /// The same without angles: speeds of named wheels, radians per second.
    Spins(Vec<(String, f64)>),
}

/// The types that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Range,
    Scan,
    Odometry,
    Joints,
}

impl Kind {
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "sensor_msgs/msg/Range" => Some(Self::Range),
            "sensor_msgs/msg/LaserScan" => Some(Self::Scan),
            "nav_msgs/msg/Odometry" => Some(Self::Odometry),
            "sensor_msgs/msg/JointState" => Some(Self::Joints),
            _ => None,
        }
    }

    /// Reads a message; none if its bytes are not of this type.
    pub(super) fn read(self, bytes: &[u8]) -> Option<(f64, Message)> {
        let mut cdr = Cdr::new(bytes)?;
        let (stamp_s, frame) = cdr.header()?;
        let message = match self {
            Self::Range => range(&mut cdr, frame)?,
            Self::Scan => scan(&mut cdr)?,
            Self::Odometry => odometry(&mut cdr)?,
            Self::Joints => joints(&mut cdr)?,
        };
        Some((stamp_s, message))
    }
}

fn range(cdr: &mut Cdr<'_>, frame: String) -> Option<Message> {
    cdr.u8()?;
    let [_view_rad, _min_m, max_m, range_m] = [cdr.f32()?, cdr.f32()?, cdr.f32()?, cdr.f32()?];
    let is_nothing = range_m > max_m || (range_m >= max_m && max_m > 0.0);
    // REP-117: -infinity is too close.
    let range_m = if is_nothing { f64::INFINITY } else { decimal(if range_m < 0.0 { 0.0 } else { range_m }) };
    Some(Message::Range { frame, range_m })
}

/// The decimal number that a 32-bit float stands for: 0.663, not 0.66299998.
fn decimal(value: f64) -> f64 {
    #[expect(clippy::cast_possible_truncation, reason = "it was a 32-bit float")]
    let float = value as f32;
    float.to_string().parse().unwrap_or(value)
}

fn scan(cdr: &mut Cdr<'_>) -> Option<Message> {
    let [first_rad, _last_rad, step_rad, _step_s, _scan_s, _min_m, max_m] =
        [cdr.f32()?, cdr.f32()?, cdr.f32()?, cdr.f32()?, cdr.f32()?, cdr.f32()?, cdr.f32()?];
    let count = cdr.count(4)?;
    let beam = |range_m: f64| if range_m >= max_m { f64::INFINITY } else { range_m };
    let ranges_m = (0..count).map(|_| cdr.f32().map(beam)).collect::<Option<_>>()?;
    Some(Message::Scan { first_rad, step_rad, ranges_m })
}

fn odometry(cdr: &mut Cdr<'_>) -> Option<Message> {
    cdr.text()?;
    let [x_m, y_m, _z_m, x, y, z, w] =
        [cdr.f64()?, cdr.f64()?, cdr.f64()?, cdr.f64()?, cdr.f64()?, cdr.f64()?, cdr.f64()?];
    let theta_rad = libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
    let pose = Pose2::new(x_m, y_m, theta_rad);
    [x_m, y_m, theta_rad].iter().all(|value| value.is_finite()).then_some(Message::Odometry(pose))
}

fn joints(cdr: &mut Cdr<'_>) -> Option<Message> {
    let count = cdr.count(4)?;
    let names: Vec<String> = (0..count).map(|_| cdr.text()).collect::<Option<_>>()?;
    let count = cdr.count(8)?;
    let angles: Vec<f64> = (0..count).map(|_| cdr.f64()).collect::<Option<_>>()?;
    if angles.iter().any(|angle_rad| angle_rad.is_finite()) {
        return Some(Message::Joints(named(names, angles)));
    }
    let count = cdr.count(8)?;
    let spins: Vec<f64> = (0..count).map(|_| cdr.f64()).collect::<Option<_>>()?;
    Some(Message::Spins(named(names, spins)))
}

/// The numbers that are known, with their names.
fn named(names: Vec<String>, numbers: Vec<f64>) -> Vec<(String, f64)> {
    names.into_iter().zip(numbers).filter(|(_, number)| number.is_finite()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header at 1.5 s with the frame `s`, then bytes.
    fn with_header(rest: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0, 1, 0, 0];
        bytes.extend(1i32.to_le_bytes());
        bytes.extend(500_000_000u32.to_le_bytes());
        bytes.extend(2u32.to_le_bytes());
        bytes.extend(b"s\0");
        bytes.extend(rest);
        bytes
    }

    fn range_of(range_m: f32) -> f64 {
        let mut rest = vec![0, 0];
        [0.4f32, 0.02, 3.0, range_m].iter().for_each(|value| rest.extend(value.to_le_bytes()));
        match Kind::Range.read(&with_header(&rest)) {
            Some((stamp_s, Message::Range { frame, range_m })) if frame == "s" && (stamp_s - 1.5).abs() < 1e-12 => {
                range_m
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn ranges_follow_rep_117() {
        assert!((range_of(1.25) - 1.25).abs() < 1e-7);
        assert!(range_of(f32::INFINITY).is_infinite() && range_of(3.0).is_infinite());
        assert!(range_of(f32::NEG_INFINITY) == 0.0 && range_of(f32::NAN).is_nan());
    }

    #[test]
    fn cut_messages_are_none() {
        let bytes = with_header(&[0; 18]);
        assert!(Kind::Range.read(&bytes).is_some());
        for length in 0..bytes.len() {
            assert!(Kind::Range.read(&bytes[..length]).is_none(), "{length}");
        }
        let long = with_header(&[0xff; 64]);
        assert!(Kind::Joints.read(&long).is_none() && Kind::Scan.read(&long).is_none());
    }
}
