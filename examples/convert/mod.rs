//! Converts the formats of public recordings to the ring CSV.

use slamd_core::{Config, Pose2};
use slamd_eval::import::WheelTicks;
use std::error::Error;
use std::io::Write;

pub(crate) type Failure = Box<dyn Error>;

fn header(sensors: usize, out: &mut impl Write) -> std::io::Result<()> {
    let names: Vec<String> = (0..sensors).map(|sensor| format!("r{sensor}")).collect();
    writeln!(out, "t_s,left_ticks,right_ticks,{}", names.join(","))
}

fn numbers(line: &str, min: usize) -> Result<Vec<f64>, Failure> {
    let numbers: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    if numbers.len() < min { Err(format!("`{line}`: fewer than {min} numbers").into()) } else { Ok(numbers) }
}

/// Converts `t_ms s0..s7` in millimetres, with 5110 for no echo, and `t_ms x_mm y_mm theta` with theta
/// in tenths of a degree.
pub(crate) fn corridor(measurement: &str, poses: &str, out: &mut impl Write) -> Result<(), Failure> {
    let config = Config::from_toml(include_str!("../../configs/corridor8.toml"))?;
    let mut wheels = WheelTicks::new(&config.robot).ok_or("no ticks_per_turn")?;
    header(8, out)?;
    for (ranges, pose) in measurement.lines().zip(poses.lines()) {
        let (ranges, pose) = (numbers(ranges, 9)?, numbers(pose, 4)?);
        let [left, right] = wheels.at(Pose2::new(pose[1] * 1e-3, pose[2] * 1e-3, (pose[3] * 0.1).to_radians()));
        write!(out, "{:.3},{left},{right}", ranges[0] * 1e-3)?;
        for range_mm in &ranges[1..9] {
            if *range_mm >= 5110.0 { write!(out, ",inf")? } else { write!(out, ",{:.3}", range_mm * 1e-3)? }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Converts `S1,..,S24,class` in metres, where 5 and more is no echo, at nine rows per second.
#[allow(dead_code, reason = "one of the two examples does not use it")]
pub(crate) fn scitos(csv: &str, out: &mut impl Write) -> Result<(), Failure> {
    header(24, out)?;
    for (row, line) in csv.lines().skip(1).enumerate() {
        write!(out, "{:.6},,", row as f64 / 9.0)?;
        for field in line.split(',').take(24) {
            let range_m: f64 = field.parse()?;
            if range_m >= 5.0 { write!(out, ",inf")? } else { write!(out, ",{range_m}")? }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Converts `t_us _ left right ..` and, from token 24 on, 682 ranges in millimetres from -120 to 120
/// degrees. Values below 20 are error codes.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a beam from 0 to 681")]
pub(crate) fn mines(dat: &str, out: &mut impl Write) -> Result<(), Failure> {
    header(21, out)?;
    for line in dat.lines() {
        let tokens = numbers(line, 24 + 682)?;
        write!(out, "{:.6},{},{}", tokens[0] * 1e-6, tokens[2], tokens[3])?;
        for sensor in -10..=10 {
            let bearing_deg = 11.25 * f64::from(sensor);
            let beam = ((bearing_deg + 120.0) / 240.0 * 681.0).round() as usize;
            let range_mm = tokens[24 + beam];
            if range_mm < 20.0 { write!(out, ",")? } else { write!(out, ",{:.3}", range_mm * 1e-3)? }
        }
        writeln!(out)?;
    }
    Ok(())
}
