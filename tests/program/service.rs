//! What the real program reports to the service manager: ready, status, stopping, and a watchdog that only the pipeline's own loop feeds.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::io::{BufRead as _, BufReader};
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const SOON: Duration = Duration::from_secs(20);
/// The patience of the watchdog: less than the unit's, for no test waits half a minute.
const PATIENCE: Duration = Duration::from_millis(2_000);

/// A service manager, which listens all the time.
struct Manager {
    messages: Receiver<(Instant, String)>,
    heard: Vec<(Instant, String)>,
}

impl Manager {
    #[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
    fn new(address: &SocketAddr) -> Self {
        let socket = UnixDatagram::bind_addr(address).unwrap();
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            let mut message = [0; 4096];
            while let Ok(length) = socket.recv(&mut message) {
                let text = String::from_utf8_lossy(&message[..length]).into_owned();
                if sender.send((Instant::now(), text)).is_err() {
                    return;
                }
            }
        });
        Self { messages, heard: Vec::new() }
    }

    /// The next message; none where none comes in time.
    fn next(&mut self, within: Duration) -> Option<String> {
        let message = self.messages.recv_timeout(within).ok()?;
        self.heard.push(message.clone());
        Some(message.1)
    }

    /// Waits for a message that contains `words`.
    #[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
    fn expect(&mut self, words: &str) -> String {
        let end = Instant::now() + SOON;
        while let Some(message) = self.next(end.saturating_duration_since(Instant::now())) {
            if message.contains(words) {
                return message;
            }
        }
        panic!("no \"{words}\" among {:?}", self.heard);
    }

    /// The times of all feedings so far.
    fn feedings(&self) -> Vec<Instant> {
        self.heard.iter().filter(|(_, message)| message == "WATCHDOG=1").map(|(at, _)| *at).collect()
    }

    /// Listens for so long, and counts the feedings.
    #[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
    fn listen(&mut self, span: Duration) -> usize {
        let (end, before) = (Instant::now() + span, self.feedings().len());
        while Instant::now() < end {
            self.next(end.saturating_duration_since(Instant::now()));
        }
        self.feedings().len() - before
    }
}

/// `slamd --port FOLDER/board`, started as systemd does.
fn program(folder: &Path, notify: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(folder.join("board")).arg("--out").arg(folder.join("out"));
    command.arg("--session").arg(folder.join("home.session"));
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    command
        .env("NOTIFY_SOCKET", notify)
        .env("WATCHDOG_USEC", PATIENCE.as_micros().to_string())
        .env_remove("WATCHDOG_PID");
    command
}

#[test]
fn it_is_ready_without_a_board_tells_its_state_and_feeds_the_watchdog() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("notify");
    let mut manager = Manager::new(&SocketAddr::from_pathname(&place).unwrap());
    let mut daemon = Daemon::run(program(folder.path(), place.to_str().unwrap()));
    let first = manager.expect("READY=1");
    assert_eq!(manager.heard.len(), 1, "nothing comes before READY: {:?}", manager.heard);
    assert!(first.starts_with("READY=1\nSTATUS=searching: port missing"), "{first}");
    let waiting = manager.listen(PATIENCE);
    assert!((2..=5).contains(&waiting), "four feedings are wanted while the port is searched for, not {waiting}");
    let board = Plugged::new(&folder.path().join("board"), Device::new(Board::broken(1, &["3:missing"]), 1));
    manager.expect("STATUS=streaming, 32 sensors, 0 faulty");
    manager.expect("STATUS=streaming, 32 sensors, 1 faulty");
    let streaming = manager.listen(PATIENCE);
    assert!((2..=5).contains(&streaming), "four feedings are wanted while sweeps arrive, not {streaming}");
    daemon.expect("poses and map begin", SOON);
    board.unplug();
    let gone = manager.expect("STATUS=searching: ");
    assert!(gone.ends_with(", 32 sensors, 1 faulty"), "{gone}");
    daemon.expect("link: searching", SOON);
    let feedings = manager.feedings();
    let gaps = feedings.windows(2).map(|pair| pair[1] - pair[0]);
    assert!(gaps.clone().all(|gap| gap < PATIENCE), "systemd would have lost its patience: {:?}", gaps.max());
    daemon.end();
    let last = manager.expect("STOPPING=1");
    assert!(last.contains("\nSTATUS=stopping"), "{last}");
    assert_eq!(manager.next(Duration::from_millis(50)), None, "nothing comes after STOPPING");
    let ready = manager.heard.iter().filter(|(_, message)| message.contains("READY=1")).count();
    assert_eq!(ready, 1, "{:?}", manager.heard);

    // The saved state is there the next time; the first time the file need not exist.
    assert!(folder.path().join("home.session").exists());
    let mut again = Daemon::run(program(folder.path(), place.to_str().unwrap()));
    let _board = Plugged::new(&folder.path().join("board"), Device::new(Board::broken(1, &["3:missing"]), 1));
    manager.expect("STATUS=streaming, 32 sensors, 1 faulty");
    assert!(!again.has_said("no session file yet"));
    again.end();
}

/// Stops one thread, as a debugger does, until its standard input is closed.
const HOLD: &str = r#"
import ctypes, os, sys
ptrace = ctypes.CDLL(None).ptrace
ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
ptrace.restype = ctypes.c_long
ATTACH, DETACH, WAIT_ALL = 16, 17, 0x40000000
thread = int(sys.argv[1])
if ptrace(ATTACH, thread, None, None) == 0:
    os.waitpid(thread, WAIT_ALL)
    print("held", flush=True)
    sys.stdin.read()
    ptrace(DETACH, thread, None, None)
"#;

#[test]
fn a_pipeline_that_hangs_does_not_feed_the_watchdog() {
    let folder = tempfile::tempdir().unwrap();
    // A name without a file, as some managers have it.
    let name = format!("slamd-service-{}", std::process::id());
    let mut manager = Manager::new(&SocketAddr::from_abstract_name(&name).unwrap());
    let mut daemon = Daemon::run(program(folder.path(), &format!("@{name}")));
    manager.expect("READY=1");
    let _board = Plugged::new(&folder.path().join("board"), Device::new(Board::robot(1), 1));
    manager.expect("STATUS=streaming, 32 sensors, 0 faulty");
    manager.expect("WATCHDOG=1");
    // The first thread is the pipeline's; no other thread hangs.
    let mut python = Command::new("python3");
    python.args(["-c", HOLD, &daemon.pid().to_string()]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut holder = python.spawn().unwrap();
    let mut held = String::new();
    BufReader::new(holder.stdout.take().unwrap()).read_line(&mut held).unwrap();
    if held.is_empty() {
        println!("skipped: this machine lets nobody stop a thread");
        holder.wait().unwrap();
        return;
    }
    manager.listen(PATIENCE);
    assert_eq!(manager.listen(PATIENCE), 0, "the pipeline hangs, and yet the watchdog is fed: {:?}", manager.heard);
    // It continues when the thread does.
    drop(holder.stdin.take());
    assert!(holder.wait().unwrap().success());
    manager.expect("WATCHDOG=1");
    assert!(daemon.has_said("link: streaming"));
    daemon.end();
}

#[test]
fn a_manager_that_does_not_listen_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut nobody = Daemon::run(program(folder.path(), folder.path().join("nowhere").to_str().unwrap()));
    nobody.expect("no connection to the service manager", SOON);
    nobody.expect("link: searching", SOON);
    nobody.end();
    let place = folder.path().join("notify");
    let _deaf = UnixDatagram::bind(&place).unwrap();
    let mut command = program(folder.path(), place.to_str().unwrap());
    // Such a watchdog is fed each time the loop goes round: the socket is full after some ten messages.
    command.env("WATCHDOG_USEC", "1");
    let mut daemon = Daemon::run(command);
    let _board = Plugged::new(&folder.path().join("board"), Device::new(Board::robot(1), 1));
    daemon.expect("poses and map begin", SOON);
    daemon.end();
}
