//! The program is killed or hangs, or its cable is cut, while it drives: the robot stands in time.

use super::{Owner, plugged};
use crate::mock_port::{Board, Device, Plugged};
use crate::served::{SOON, Served};
use std::process::Command;
use std::time::{Duration, Instant};

/// The robot stands so long after the last frame that reached the board: 250 ms of silence at most, and 150 ms to brake.
pub const STANDSTILL: Duration = Duration::from_millis(400);
/// Drives last so long at most before they end.
const LONGEST_US: u64 = 900_000;

/// How a drive ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The program was killed with SIGKILL.
    Killed,
    /// The cable was cut.
    Cut,
    /// The program was stopped with SIGSTOP and woke later.
    Wedged,
}

/// What one end showed.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    pub ended: Ended,
    /// How long a wheel went on turning.
    pub turned: Duration,
    /// How long the machine kept the simulated board from looking at its line: no fault of the program.
    pub late: Duration,
}

/// Ends `count` drives at moments drawn from the seed, in each of the three ways in turn.
pub fn dead_man(count: u64, seed: u64, mut progress: impl FnMut()) -> Vec<Stop> {
    let mut stops = Vec::new();
    let mut device = Some(Device::new(Board::standing(seed), seed));
    while (stops.len() as u64) < count {
        let (served, plugged) = plugged(&["--socket", "api.sock", "--drive"], device.take().expect("it came back"));
        device = Some(rounds(served, plugged, count, seed, &mut stops, &mut progress));
    }
    stops
}

/// A few cuts and wedges of one program, and at last its kill.
#[expect(clippy::disallowed_methods, reason = "the end is a moment in real time")]
fn rounds(
    mut served: Served,
    mut plugged: Plugged,
    count: u64,
    seed: u64,
    stops: &mut Vec<Stop>,
    progress: &mut impl FnMut(),
) -> Device {
    for ended in [Ended::Cut, Ended::Wedged, Ended::Killed] {
        let random = (seed ^ stops.len() as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11;
        let mut owner = Owner::new(&served.folder.path().join("api.sock"));
        owner.turns(Duration::from_micros(200_000 + random % LONGEST_US));
        std::thread::sleep(Duration::from_micros(random % 50_000));
        assert!(plugged.peak_m_s() > 0.05, "it did not drive: {} m/s", plugged.peak_m_s());
        let pid = served.daemon.pid().to_string();
        let signal = |name: &str| assert!(Command::new("kill").args([name, &pid]).status().unwrap().success());
        let late = plugged.late();
        let (turned, late) = match ended {
            Ended::Cut => {
                let mut device = plugged.unplug();
                let turned = device.runs_out(Duration::from_secs(2));
                served.daemon.expect("link: searching", SOON);
                drop(owner);
                plugged = Plugged::new(&served.board(), device);
                served.daemon.expect("link: streaming", SOON);
                (turned, late)
            }
            Ended::Wedged | Ended::Killed => {
                signal(if ended == Ended::Killed { "-KILL" } else { "-STOP" });
                let moment = Instant::now();
                std::thread::sleep(Duration::from_secs(1));
                let turned = plugged.turned_after(moment);
                if ended == Ended::Wedged {
                    // What it wakes up with was ordered long ago.
                    drop(owner);
                    signal("-CONT");
                }
                (turned, plugged.late())
            }
        };
        stops.push(Stop { ended, turned, late });
        progress();
        if stops.len() as u64 == count {
            break;
        }
    }
    plugged.unplug()
}
