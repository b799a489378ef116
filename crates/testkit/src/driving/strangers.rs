//! Those that may not drive try: readers, wrong tokens, malformed and replayed lines, browsers, MQTT.

use super::Owner;
use crate::mock_port::{Board, Device, Plugged};
use crate::mosquitto::Mosquitto;
use crate::served::{SOON, Served};
use slamd_capture::{CaptureReader, Record};
use slamd_protocol::{FrameDecoder, kind};
use slamd_sim::random::{Random, Stream};
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

const READS: &str = "0123456789abcdef-reads";
const DRIVES: &str = "fedcba9876543210-drives";

/// What came of the tries.
#[derive(Clone, Copy, Debug)]
pub struct Strangers {
    pub tries: u64,
    /// Tries that slamd answered with an ERROR.
    pub refused: u64,
    /// The highest speed of a wheel, metres per second, while strangers tried, and after that, when the owner drove.
    pub peak_m_s: [f64; 2],
    /// DRIVE frames that the board was sent while strangers tried.
    pub drives: u64,
}

/// Lines that would move the robot, were they the owner's.
fn order(random: &mut Random) -> String {
    let speed = random.uniform(-0.3, 0.3);
    match random.below(4) {
        0 => format!("?DRIVE={{\"forward_m_s\":{speed:.2}}};"),
        1 => format!("?DRIVE={{\"turn_rad_s\":{speed:.2},\"for_ms\":1000}};"),
        2 => format!("?DRIVE={{\"forward_m_s\":{speed:.2},\"turn_rad_s\":1,\"autonomous\":true}}"),
        _ => "?DRIVE={\"turn_rad_s\":1.0};\n?STOP;\n?DRIVE={\"turn_rad_s\":1.0};".into(),
    }
}

/// A word that is nearly the token.
fn wrong(random: &mut Random) -> String {
    let at = random.below(DRIVES.len());
    match random.below(6) {
        0 => DRIVES[..at].into(),
        1 => format!("{DRIVES}{DRIVES}"),
        2 => format!("{DRIVES} "),
        3 => DRIVES.to_uppercase(),
        4 => format!("{}x{}", &DRIVES[..at], &DRIVES[at + 1..]),
        _ => String::new(),
    }
}

/// A line with a byte changed, left out or put in; what a client without the right makes of it does not matter.
fn damaged(line: &str, random: &mut Random) -> Vec<u8> {
    let mut bytes = line.as_bytes().to_vec();
    let (at, byte) = (random.below(bytes.len()), random.bits().to_le_bytes()[0]);
    match random.below(3) {
        0 => bytes[at] = byte,
        1 => drop(bytes.remove(at)),
        _ => bytes.insert(at, byte),
    }
    bytes
}

/// Sends bytes to a TCP port, and reads what comes until it is silent or at its end.
fn tell(address: &str, bytes: &[u8]) -> String {
    let Ok(mut stream) = TcpStream::connect(address) else { return String::new() };
    let _ = stream.set_read_timeout(Some(Duration::from_secs(5)));
    let _ = stream.write_all(bytes);
    // A half-closed connection is answered and closed.
    let _ = stream.shutdown(std::net::Shutdown::Write);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn private(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).unwrap();
}

/// Where they try.
struct Doors {
    lines_at: String,
    pages_at: String,
    broker: Mosquitto,
    socket: PathBuf,
}

impl Doors {
    /// One try, and what it was answered.
    fn attempt(&self, number: u64, random: &mut Random) -> String {
        let order = order(random);
        match number % 8 {
            0 => tell(&self.lines_at, format!("{order}\n").as_bytes()),
            1 | 2 => tell(&self.lines_at, format!("?TOKEN=\"{READS}\";\n{order}\n").as_bytes()),
            3 => tell(&self.lines_at, format!("?TOKEN=\"{}\";\n{order}\n", wrong(random)).as_bytes()),
            4 => {
                let begin = format!("?TOKEN=\"{READS}\";\n?TOKEN=\"{}\";\n", wrong(random));
                tell(&self.lines_at, &[begin.as_bytes(), order.as_bytes(), b"\n"].concat())
            }
            5 => {
                let begin = format!("?TOKEN=\"{READS}\";\n");
                tell(&self.lines_at, &[begin.as_bytes(), &damaged(&order, random), b"\n"].concat())
            }
            6 => {
                let at = if number % 16 == 6 { &self.lines_at } else { &self.pages_at };
                let head = format!("POST / HTTP/1.1\r\nHost: {at}\r\nAuthorization: Bearer {READS}\r\n\r\n{order}\n");
                tell(at, head.as_bytes())
            }
            // A program per message is slow: some stand for all.
            _ if number % 80 == 7 => {
                let topic = ["set", "cmd", "drive", "command", "drive/set"][random.below(5)];
                let topic = format!("slamd/robot/{topic}");
                let port = self.broker.port().to_string();
                let mut publish = Command::new("mosquitto_pub");
                publish.args(["-h", "127.0.0.1", "-p", &port, "-t", &topic, "-m", &order]);
                assert!(publish.status().expect("Debian's package mosquitto-clients").success());
                String::new()
            }
            _ => malformed(&self.socket, number),
        }
    }
}

/// Makes `tries` tries, drawn from the seed.
///
/// # Panics
/// When the owner cannot drive afterwards: then the tries prove nothing.
pub fn strangers(tries: u64, seed: u64, mut progress: impl FnMut()) -> Strangers {
    let files = tempfile::tempdir().unwrap();
    let [reads, drives, capture] = ["reads", "drives", "drive.mcap"].map(|name| files.path().join(name));
    private(&reads, READS);
    private(&drives, DRIVES);
    let broker = Mosquitto::start(None);
    let broker_at = broker.address();
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    let (reads, drives, recording) = (path(&reads), path(&drives), path(&capture));
    let options = [
        "--listen",
        "127.0.0.1:0",
        "--metrics",
        "127.0.0.1:0",
        "--socket",
        "api.sock",
        "--drive",
        "--token-file",
        &reads,
        "--drive-token-file",
        &drives,
        "--mqtt",
        &broker_at,
        "--record",
        &recording,
    ];
    let mut served = Served::new(&options);
    let (lines_at, _socket, pages_at) = (served.address(), served.address(), served.address());
    let plugged = Plugged::new(&served.board(), Device::new(Board::standing(seed), seed));
    served.daemon.expect("link: streaming", SOON);
    let mut random = Random::new(seed, Stream::Fault);
    let mut refused = 0;
    let doors = Doors { lines_at, pages_at, broker, socket: served.folder.path().join("api.sock") };
    for number in 0..tries {
        refused += u64::from(doors.attempt(number, &mut random).contains("\"ERROR\""));
        progress();
    }
    let peak_m_s = plugged.peak_m_s();
    let mut owner = Owner::new(&served.folder.path().join("api.sock"));
    owner.turns(Duration::from_millis(500));
    let owners_m_s = plugged.peak_m_s();
    served.daemon.end();
    drop(plugged);
    let moves_a_wheel = |payload: &Vec<u8>| payload[..4].iter().any(|byte| *byte != 0);
    let drives: Vec<bool> = sent_drives(&capture).iter().map(moves_a_wheel).collect();
    let by_owner = drives.iter().filter(|moves| **moves).count();
    assert!(owners_m_s > 0.05 && by_owner > 5, "the owner cannot drive: {owners_m_s} m/s");
    let before = drives.iter().position(|moves| *moves).unwrap_or(drives.len());
    Strangers { tries, refused, peak_m_s: [peak_m_s, owners_m_s], drives: before as u64 }
}

/// Lines of the owner that are no orders.
fn malformed(socket: &Path, number: u64) -> String {
    const LINES: [&str; 10] = [
        "?DRIVE;",
        "?DRIVE=;",
        "?DRIVE={\"forward_m_s\":0.2;",
        "?DRIVE={\"forward_m_s\":\"0.2\"};",
        "?DRIVE={\"forward_m_s\":1e999};",
        "?DRIVE={\"forward_m_s\":0.2,\"for_ms\":0};",
        "?DRIVE={\"forward_m_s\":0.2,\"for_ms\":99999};",
        "?DRIVE={\"forward\":0.2};",
        "?drive={\"forward_m_s\":0.2};",
        "DRIVE={\"forward_m_s\":0.2};",
    ];
    let mut owner = Owner::new(socket);
    #[expect(clippy::cast_possible_truncation, reason = "a few lines")]
    let answer = owner.ask(LINES[number as usize / 8 % LINES.len()]);
    answer.to_string()
}

/// The payloads of the DRIVE frames that a recording's host sent, in order.
///
/// # Panics
/// If the recording cannot be read.
#[must_use]
pub fn sent_drives(capture: &Path) -> Vec<Vec<u8>> {
    let mut decoder = FrameDecoder::new();
    let mut drives = Vec::new();
    for record in CaptureReader::open(capture).unwrap() {
        let Record::Sent { bytes, .. } = record.unwrap() else { continue };
        for byte in bytes {
            if let Some(frame) = decoder.push(byte).filter(|frame| frame.kind == kind::DRIVE) {
                drives.push(frame.payload.to_vec());
            }
        }
    }
    drives
}
