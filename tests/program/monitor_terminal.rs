//! `slamd monitor` on a pseudo-terminal: it draws, it heeds keys and signals, and it gives the terminal back.

#![allow(clippy::unwrap_used, reason = "a test may")]

use rustix::pty::{OpenptFlags, grantpt, ioctl_tiocgptpeer, openpt, unlockpt};
use rustix::termios::{Action, LocalModes, Winsize, tcflow, tcgetattr, tcsetwinsize};
use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

const ENTER: &str = "\x1b[?1049h";
const LEAVE: &str = "\x1b[?1049l";
const SHOW_CURSOR: &str = "\x1b[?25h";
const HIDE_CURSOR: &str = "\x1b[?25l";

/// A busy computer takes long.
const PATIENCE: Duration = Duration::from_secs(120);

/// The program in a session of its own on a terminal of its own.
pub(crate) struct Watched {
    child: Child,
    master: File,
    written: Vec<u8>,
}

impl Watched {
    fn start(arguments: &[&str], out: &Path) -> Self {
        Self::run(&[&["monitor"], arguments, &["--out", out.to_str().unwrap()]].concat())
    }

    /// Any command.
    pub(crate) fn run(arguments: &[&str]) -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        tcsetwinsize(&master, Winsize { ws_row: 30, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
        let slave = || Stdio::from(ioctl_tiocgptpeer(&master, flags).unwrap());
        let child = Command::new("setsid")
            .args(["--ctty", env!("CARGO_BIN_EXE_slamd")])
            .args(arguments)
            .envs([("LC_ALL", "C.UTF-8"), ("TERM", "xterm-256color")])
            .env_remove("NO_COLOR")
            .stdin(slave())
            .stdout(slave())
            .stderr(slave())
            .spawn()
            .unwrap();
        rustix::io::ioctl_fionbio(&master, true).unwrap();
        Self { child, master: master.into(), written: Vec::new() }
    }

    /// Waits until it has written something.
    #[expect(clippy::disallowed_methods, reason = "the test waits in real time")]
    pub(crate) fn expect_text(&mut self, words: &str) {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            self.read();
            if self.text().contains(words) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("no \"{words}\" in\n{}", self.text());
    }

    /// Waits until the screen shows something.
    #[expect(clippy::disallowed_methods, reason = "the test waits in real time")]
    fn expect(&mut self, words: &str) {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            self.read();
            if self.screen().contains(words) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("no \"{words}\" on\n{}", self.screen());
    }

    #[expect(clippy::disallowed_methods, reason = "the test waits in real time")]
    pub(crate) fn end(&mut self) -> ExitStatus {
        let end = Instant::now() + PATIENCE;
        while Instant::now() < end {
            self.read();
            if let Some(status) = self.child.try_wait().unwrap() {
                self.read();
                return status;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("it does not end; the screen:\n{}", self.screen());
    }

    fn read(&mut self) {
        let mut chunk = [0; 4096];
        while let Ok(count @ 1..) = self.master.read(&mut chunk) {
            self.written.extend(&chunk[..count]);
        }
    }

    pub(crate) fn press(&mut self, keys: &str) {
        self.master.write_all(keys.as_bytes()).unwrap();
    }

    fn signal(&self, name: &str) {
        let status = Command::new("kill").args([name, &self.child.id().to_string()]).status().unwrap();
        assert!(status.success());
    }

    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.written).into_owned()
    }

    /// What is on the alternate screen: cursor moves and letters, all else left out.
    fn screen(&self) -> String {
        let text = self.text();
        let inside = text.split(ENTER).nth(1).unwrap_or_default().split(LEAVE).next().unwrap_or_default();
        let mut rows = vec![vec![' '; 100]; 30];
        let (mut row, mut column) = (0, 0);
        let mut pieces = inside.split("\x1b[");
        let mut put = |letters: &str, row: usize, column: &mut usize| {
            for letter in letters.chars() {
                if let Some(cell) = rows.get_mut(row).and_then(|cells| cells.get_mut(*column)) {
                    *cell = letter;
                }
                *column += 1;
            }
        };
        put(pieces.next().unwrap_or_default(), row, &mut column);
        for piece in pieces {
            let end = piece.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(piece.len());
            let (order, letters) = piece.split_at(end);
            if letters.starts_with('H') {
                let mut numbers = order.split(';').map(|number| number.parse().unwrap_or(1));
                (row, column) = (numbers.next().unwrap_or(1) - 1, numbers.next().unwrap_or(1) - 1);
            }
            put(letters.get(1..).unwrap_or_default(), row, &mut column);
        }
        rows.iter().map(|cells| cells.iter().collect::<String>() + "\n").collect()
    }

    /// The terminal is as it was before.
    fn assert_given_back(&self) {
        let text = self.text();
        assert_eq!(text.matches(ENTER).count(), 1);
        assert_eq!(text.matches(LEAVE).count(), 1, "{text:?}");
        assert!(text.rfind(SHOW_CURSOR) > text.rfind(HIDE_CURSOR), "the cursor is hidden");
        let modes = tcgetattr(&self.master).unwrap().local_modes;
        assert!(modes.contains(LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG), "{modes:?}");
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const CAPTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-paper-faults.mcap");

#[test]
fn a_capture_plays_until_q() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::start(&["--capture", CAPTURE, "--speed", "20"], folder.path());
    // The word "playing" may have gone before a busy computer looks.
    watched.expect("slamd monitor");
    watched.expect("12 gives no measurement");
    watched.expect("ratio");
    // A pose in degrees: with it the map begins.
    watched.expect("°");
    watched.press("?");
    watched.expect("Ctrl-C");
    watched.press("p");
    watched.expect("paused");
    watched.press("q");
    assert!(watched.end().success(), "{}", watched.text());
    watched.assert_given_back();
    let text = watched.text();
    let after = text.split(LEAVE).nth(1).unwrap();
    assert!(after.contains("map.png") && after.contains("sensor 12"), "the summary comes after the screen: {after:?}");
}

#[test]
fn the_end_of_a_capture_stays_on_the_screen() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::start(&["--capture", CAPTURE, "--speed", "1000"], folder.path());
    watched.expect("is over; q quits");
    // Ctrl-C, as a raw terminal passes it.
    watched.press("\x03");
    assert!(watched.end().success());
    watched.assert_given_back();
    let summary = std::fs::read_to_string(folder.path().join("summary.json")).unwrap();
    let replayed = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.args(["replay", CAPTURE, "--out"]).arg(replayed.path());
    assert!(command.output().unwrap().status.success());
    let of_replay = std::fs::read_to_string(replayed.path().join("summary.json")).unwrap();
    let hash = |summary: &str| {
        let summary: serde_json::Value = serde_json::from_str(summary).unwrap();
        (summary["map_sha256"].to_string(), summary["trajectory_sha256"].to_string())
    };
    assert_eq!(hash(&summary), hash(&of_replay), "watching changes nothing");
}

#[test]
fn a_terminated_monitor_gives_the_terminal_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::start(&["--capture", CAPTURE], folder.path());
    watched.expect("playing");
    watched.signal("-TERM");
    assert!(watched.end().success());
    watched.assert_given_back();
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the test waits in real time")]
fn a_stalled_terminal_never_blocks_mapping() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::start(&["--capture", CAPTURE, "--speed", "20"], folder.path());
    watched.expect("playing");
    // As Ctrl-S does, or a connection that stalls.
    let peer = ioctl_tiocgptpeer(&watched.master, OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    tcflow(&peer, Action::OOff).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    watched.read();
    let written = watched.written.len();
    // It grows under a temporary name.
    let size = || {
        let files = std::fs::read_dir(folder.path()).unwrap().map(Result::unwrap);
        let growing = files.filter(|file| file.file_name().to_string_lossy().starts_with(".trajectory.tum."));
        growing.map(|file| file.metadata().map_or(0, |file| file.len())).sum::<u64>()
    };
    let (before, end) = (size(), Instant::now() + PATIENCE);
    while size() < before + 10_000 {
        assert!(Instant::now() < end, "the session stands still");
        std::thread::sleep(Duration::from_millis(10));
    }
    watched.read();
    assert_eq!(watched.written.len(), written, "it took something");
    watched.signal("-TERM");
    assert!(watched.end().success());
    assert!(folder.path().join("summary.json").exists());
}

#[test]
fn a_lost_connection_keeps_the_map() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::start(&["--capture", CAPTURE], folder.path());
    watched.expect("playing");
    // As sshd does: the other end of the terminal is closed.
    watched.master = File::open("/dev/null").unwrap();
    assert!(watched.end().success());
    assert!(folder.path().join("summary.json").exists());
}

#[test]
fn a_robot_is_watched_while_its_cable_comes_and_goes() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("robot");
    let recording = folder.path().join("drive.mcap");
    let arguments = ["--port", port.to_str().unwrap(), "--record", recording.to_str().unwrap()];
    let mut watched = Watched::start(&arguments, &folder.path().join("out"));
    watched.expect("port missing");
    let plugged = Plugged::new(&port, Device::new(Board::robot(1), 1));
    watched.expect("streaming");
    watched.expect("ok 32 bad 0");
    plugged.unplug();
    watched.expect("searching");
    watched.press("q");
    // The session was too short for a map, and says so.
    assert_eq!(watched.end().code(), Some(75), "{}", watched.text());
    assert!(watched.text().contains("nothing mapped in "), "{}", watched.text());
    watched.assert_given_back();
    assert!(recording.exists() && folder.path().join("out/map.png").exists());
}
