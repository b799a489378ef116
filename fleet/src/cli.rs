//! The command line.

use crate::failure::{Failure, Kind};
use crate::fleet_file::FleetFile;
use crate::hub::Hub;
use crate::name::Name;
use crate::network::Endpoint;
use crate::robot::Robot;
use crate::union::union;
use clap::{Parser, Subcommand};
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const EXAMPLES: &str = "Examples:
  slamd-fleet hub --site home --fleet fleet.toml --out site          on this machine only
  slamd-fleet hub --site home --fleet fleet.toml --out site --listen tcp/0.0.0.0:7447 --users users
  slamd-fleet robot --site home --name kitchen --connect tcp/192.0.2.1:7447 --password-file password --capture drive.mcap
  slamd-fleet robot --site home --name kitchen --capture flat.mcap --speed 4     no hardware: plays a capture
  slamd-fleet union site/captures --fleet fleet.toml --out offline   the same map, from the captures alone

Security: hub and robots use only the given addresses; there is no discovery. Except on loopback, every robot needs its password, and can write and
answer only below its own key. Nothing is encrypted: use `ssh -L` or a VPN in networks that you do not trust.";

/// Merges the maps of several robots that run slamd.
#[derive(Debug, Parser)]
#[command(name = "slamd-fleet", version, about, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Maintain a site's map: receive the robots' data, fetch their captures, merge.
    Hub {
        /// The site's name; robots of other sites are ignored.
        #[arg(long)]
        site: Name,
        /// The robots (TOML); see fleet.example.toml.
        #[arg(long, value_name = "FILE")]
        fleet: PathBuf,
        /// Folder for captures, maps and the merged map; an existing one is continued.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Address to listen on; addresses other than loopback need --users.
        #[arg(long, value_name = "tcp/IP:PORT", default_value = "tcp/127.0.0.1:7447")]
        listen: Endpoint,
        /// File of the robots' passwords: lines NAME:PASSWORD, mode 0600.
        #[arg(long, value_name = "FILE")]
        users: Option<PathBuf>,
    },
    /// Publish what a robot's slamd records, and offer its captures.
    Robot {
        /// The site's name.
        #[arg(long)]
        site: Name,
        /// The robot's name, as in the fleet file.
        #[arg(long)]
        name: Name,
        /// The hub's address.
        #[arg(long, value_name = "tcp/HOST:PORT", default_value = "tcp/127.0.0.1:7447")]
        connect: Endpoint,
        /// File whose first line is the robot's password, mode 0600.
        #[arg(long, value_name = "FILE")]
        password_file: Option<PathBuf>,
        /// The captures to offer; the last one is followed while slamd --record writes it.
        #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
        capture: Vec<PathBuf>,
        /// Play the last capture at this multiple of real time instead of following it.
        #[arg(long, value_name = "FACTOR", value_parser = speed)]
        speed: Option<f64>,
    },
    /// Merge captures without a network; the result is identical to a hub's map.
    Union {
        /// Folder with one folder per robot, like a hub's `captures`.
        captures: PathBuf,
        /// The robots (TOML).
        #[arg(long, value_name = "FILE")]
        fleet: PathBuf,
        /// Folder for the merged map.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

impl Command {
    fn run(self) -> Result<(), Failure> {
        match self {
            Self::Hub { site, fleet, out, listen, users } => {
                Hub { site, fleet: read(&fleet)?, folder: out }.run(&listen, users.as_deref())
            }
            Self::Robot { site, name, connect, password_file, capture, speed } => {
                Robot { site, name, captures: capture, speed }.run(&connect, password_file.as_deref())
            }
            Self::Union { captures, fleet, out } => union(&captures, &read(&fleet)?, &out).map(drop),
        }
    }
}

fn read(fleet: &Path) -> Result<FleetFile, Failure> {
    FleetFile::read(fleet).map_err(|error| Failure::new(Kind::Config, error.to_string()))
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| (0.01..=1_000.0).contains(speed));
    speed.ok_or_else(|| "it must be from 0.01 to 1,000".into())
}

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { Kind::Usage as u8 } else { 0 };
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info,zenoh=error".into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .init();
    match cli.command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("slamd-fleet: {failure}");
            ExitCode::from(failure.kind as u8)
        }
    }
}
