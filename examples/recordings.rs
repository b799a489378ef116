//! Converts public recordings to the ring CSV of `slamd import ring`.
//!
//! ```sh
//! # Eight sonars and poses in a corridor. The ticks are computed from the poses, with the wheels of
//! # configs/corridor8.toml.
//! cargo run --example recordings -- corridor measurement.txt poses.txt > corridor.csv
//! slamd import ring corridor.csv --config configs/corridor8.toml --capture corridor.mcap
//!
//! # 24 sonars around a SCITOS G5, nine rows per second, no odometry.
//! cargo run --example recordings -- scitos sensor_readings_24.csv > scitos.csv
//! slamd import ring scitos.csv --config configs/scitos24.toml --capture scitos.mcap
//!
//! # Wheel ticks and 21 beams of a laser.
//! xz -dc exp1.dat.xz | cargo run --example recordings -- mines - > mines.csv
//! slamd import ring mines.csv --config configs/mines21.toml --capture mines.mcap
//! ```

mod convert;

use convert::{Failure, corridor, mines, scitos};
use std::io::{Read as _, Write as _};

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    match arguments[..] {
        ["corridor", measurement, poses] => corridor(&text(measurement)?, &text(poses)?, &mut out)?,
        ["scitos", csv] => scitos(&text(csv)?, &mut out)?,
        ["mines", dat] => mines(&text(dat)?, &mut out)?,
        _ => {
            return Err(
                "usage: recordings corridor MEASUREMENT POSES | scitos CSV | mines FILE (`-`: standard input)".into()
            );
        }
    }
    Ok(out.flush()?)
}

fn text(path: &str) -> Result<String, Failure> {
    let mut text = String::new();
    match path {
        "-" => std::io::stdin().read_to_string(&mut text).map(|_| ())?,
        _ => text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?,
    }
    Ok(text)
}
