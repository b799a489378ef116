//! The real program drives a simulated robot: its dead man, and those that may not drive.

mod dead_man;
mod strangers;

pub use dead_man::{Ended, STANDSTILL, Stop, dead_man};
pub use strangers::{Strangers, sent_drives, strangers};

use crate::mock_port::{Device, Plugged};
use crate::served::{SOON, Served};
use serde_json::Value;
use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// A client at the socket of slamd's owner.
pub struct Owner {
    stream: UnixStream,
    lines: BufReader<UnixStream>,
}

impl Owner {
    pub fn new(socket: &Path) -> Self {
        let stream = UnixStream::connect(socket).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(25))).unwrap();
        let lines = BufReader::new(stream.try_clone().unwrap());
        let mut owner = Self { stream, lines };
        assert_eq!(owner.next_line()["class"], "VERSION");
        owner
    }

    /// Sends a line and gives the next one.
    pub fn ask(&mut self, line: &str) -> Value {
        writeln!(self.stream, "{line}").unwrap();
        self.next_line()
    }

    pub fn next_line(&mut self) -> Value {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"))
    }

    /// Turns on the spot, for a second at most.
    pub fn turn(&mut self) -> Value {
        self.ask("?DRIVE={\"turn_rad_s\":1.0,\"for_ms\":1000};")
    }

    /// Turns for this long, from when the board has said who it is.
    ///
    /// # Panics
    /// When that is refused.
    #[expect(clippy::disallowed_methods, reason = "keys are held in real time")]
    pub fn turns(&mut self, span: Duration) {
        for _ in 0..200 {
            let answer = self.turn();
            if !answer["message"].as_str().is_some_and(|message| message.contains("not streaming")) {
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        for _ in 0..=span.as_millis() / 100 {
            let answer = self.turn();
            assert_eq!(answer["class"], "DRIVE", "{answer}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

/// slamd with these options and a robot that stands.
fn plugged(options: &[&str], device: Device) -> (Served, Plugged) {
    let mut served = Served::new(options);
    let plugged = Plugged::new(&served.board(), device);
    served.daemon.expect("link: streaming", SOON);
    (served, plugged)
}
