//! The log of the real program: a reader that hangs stops nothing, and what repeats is summed up.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_protocol::{FrameEncoder, Hello, Log, Message, Sonar, Text};
use slamd_testkit::mock_port::{self, Board, Device, Plugged, Terminal};
use slamd_testkit::served::{SOON, Served, get};
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");

/// Asks until `is_so`; fails after some time.
#[expect(clippy::disallowed_methods, reason = "the test waits in real time")]
fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < SOON, "not within {SOON:?}: {what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A pipe that is full, with nobody reading.
fn full_pipe() -> (std::io::PipeReader, std::io::PipeWriter) {
    let (reader, mut writer) = std::io::pipe().unwrap();
    rustix::io::ioctl_fionbio(&writer, true).unwrap();
    while writer.write(&[b'x'; 4096]).is_ok() {}
    while writer.write(b"x").is_ok() {}
    rustix::io::ioctl_fionbio(&writer, false).unwrap();
    (reader, writer)
}

fn wait(child: &mut Child) -> Option<i32> {
    let mut code = None;
    eventually("the program ends", || {
        code = child.try_wait().unwrap();
        code.is_some()
    });
    code.unwrap().code()
}

#[test]
fn a_hung_reader_of_the_log_stops_neither_the_session_nor_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let [port, out, drive] = ["board", "out", "drive.mcap"].map(|name| folder.path().join(name));
    // A free port: the log, which would tell it, cannot be read.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let (_reader, writer) = full_pipe();
    let mut command = Command::new(SLAMD);
    command.arg("--port").arg(&port).arg("--out").arg(&out).arg("--record").arg(&drive);
    command.args(["--metrics", &address]).env("XDG_CONFIG_HOME", "/nonexistent").current_dir(folder.path());
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    let mut child =
        command.stdout(Stdio::from(writer.try_clone().unwrap())).stderr(Stdio::from(writer)).spawn().unwrap();
    eventually("it listens", || TcpStream::connect(&address).is_ok());
    let is_well = || get(&address, "/healthz", "").starts_with("HTTP/1.1 200 ");
    let mut board = Plugged::new(&port, Device::new(Board::robot(1), 1));
    // Each of these is a line of the log.
    for _ in 0..3 {
        eventually("sweeps arrive", is_well);
        let device = board.unplug();
        eventually("the link is lost", || !is_well());
        board = Plugged::new(&port, device);
    }
    eventually("sweeps arrive", is_well);
    let size = || std::fs::metadata(&drive).unwrap().len();
    let before = size();
    eventually("the recording grows", || size() > before);
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let code = wait(&mut child);
    assert!(matches!(code, Some(0 | 75)), "{code:?}");
    assert!(out.join("summary.json").exists(), "map and summary are written");
}

/// Sends what `next` makes at the rate of a fast line.
fn flood(path: &Path, end: &AtomicBool, mut next: impl FnMut() -> Vec<u8>) {
    let mut terminal = Terminal::open();
    std::os::unix::fs::symlink(&terminal.path, path).unwrap();
    while !end.load(Ordering::Relaxed) {
        terminal.read();
        if terminal.write(&next()) > 0 {
            std::thread::yield_now();
        }
    }
}

/// LOG messages.
fn talk() -> impl FnMut() -> Vec<u8> + Send {
    let (mut encoder, mut number) = (FrameEncoder::new(), 0_u32);
    move || {
        let mut message = || {
            number += 1;
            encoder.encode(&Message::Log(Log { level: 1, text: Text::new(&format!("line {number}")) })).to_vec()
        };
        (0..20).flat_map(|_| message()).collect()
    }
}

/// Lines of text, delimiters and frames whose checksum is wrong.
fn garbage() -> impl FnMut() -> Vec<u8> + Send {
    let mut number = 0_u32;
    move || {
        number += 1;
        let frame = [0, 9, 1, 2, 3, 4, 5, 6, 7, 8, 0];
        [format!("Ping: {number} cm\r\n").as_bytes(), &frame, &number.to_le_bytes(), b"\0\xFF\0"].concat()
    }
}

/// A board that restarts again and again: each time it says who it is, and the link and what hangs on it begin anew.
fn restarts() -> impl FnMut() -> Vec<u8> + Send {
    let (mut encoder, mut boot_id) = (FrameEncoder::new(), 0);
    move || {
        boot_id += 1;
        let hello = Message::Hello(Hello { boot_id, ..mock_port::hello(slamd_protocol::VERSION_MAJOR) });
        let silent = Sonar {
            t_us: 1_000 * boot_id,
            group: 0,
            last_of_cycle: true,
            left_ticks: 0,
            right_ticks: 0,
            echoes: <_>::default(),
        };
        [hello, Message::Sonar(silent)].iter().flat_map(|message| encoder.encode(message).to_vec()).collect()
    }
}

/// What is logged while a board floods the line.
fn logged_under(next: impl FnMut() -> Vec<u8> + Send + 'static) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let end = Arc::new(AtomicBool::new(false));
    let board = {
        let (path, end) = (folder.path().join("board"), Arc::clone(&end));
        std::thread::spawn(move || flood(&path, &end, next))
    };
    let lines = logged(folder.path(), 15);
    end.store(true, Ordering::Relaxed);
    board.join().unwrap();
    lines
}

/// The lines that the program logs within so many seconds.
fn logged(folder: &Path, seconds: u64) -> Vec<String> {
    let mut command = Command::new(SLAMD);
    command.arg("--port").arg(folder.join("board")).arg("--out").arg(folder.join("out"));
    command.args(["--duration", &seconds.to_string()]).env("XDG_CONFIG_HOME", "/nonexistent");
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok).collect();
    child.wait().unwrap();
    lines
}

#[test]
fn a_board_that_talks_at_line_rate_writes_a_few_lines_that_say_how_many_there_were() {
    let lines = logged_under(talk());
    assert!(lines.len() < 100, "{} lines in 15 s", lines.len());
    let said = lines.iter().filter(|line| line.contains("board says: line")).count();
    assert!(said >= 30, "{lines:#?}");
    let more: Vec<u64> = lines
        .iter()
        .filter_map(|line| line.split_once(": and ")?.1.strip_suffix(" s")?.split_once(" more in "))
        .map(|(number, _)| number.replace(',', "").parse().unwrap())
        .collect();
    assert!(more.iter().sum::<u64>() > 1_000, "{lines:#?}");
}

#[test]
fn malformed_bytes_at_line_rate_write_a_few_lines() {
    let lines = logged_under(garbage());
    assert!((1..100).contains(&lines.len()), "{} lines in 15 s: {lines:#?}", lines.len());
}

#[test]
fn a_link_that_flaps_at_line_rate_writes_a_few_lines() {
    let lines = logged_under(restarts());
    assert!(lines.iter().any(|line| line.contains(" more in ")), "it does not flap: {lines:#?}");
    assert!(lines.len() < 200, "{} lines in 15 s: {lines:#?}", lines.len());
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
fn wrong_tokens_write_a_few_lines() {
    let folder = tempfile::tempdir().unwrap();
    let token = folder.path().join("token");
    std::fs::write(&token, "0123456789abcdef0123456789abcdef").unwrap();
    std::fs::set_permissions(&token, std::os::unix::fs::PermissionsExt::from_mode(0o600)).unwrap();
    let mut served = Served::new(&["--listen", "127.0.0.1:0", "--token-file", token.to_str().unwrap()]);
    let address = served.address();
    let begin = Instant::now();
    let mut attempts = 0;
    while begin.elapsed() < Duration::from_secs(12) {
        let Ok(mut stream) = TcpStream::connect(&address) else { continue };
        let _ = stream.write_all(b"?TOKEN=\"wrong\";\n?TOKEN=\"wrong\";\n?TOKEN=\"w\";\n");
        attempts += 1;
        std::thread::sleep(Duration::from_millis(1));
    }
    let (_, line) = served.daemon.line(" more in 10 s", SOON);
    assert!(line.contains("api: client 127.0.0.1:") && line.contains("wrong or missing token"), "{line}");
    assert!(attempts > 200, "{attempts}");
    let told = served.daemon.said().filter(|line| line.contains("wrong or missing token")).count();
    assert!(told < 60, "{told} lines of {attempts} attempts");
    served.daemon.end();
}

#[test]
fn the_reason_of_the_end_is_the_last_line() {
    let output = Command::new(SLAMD).args(["--port", "/dev/nowhere", "--exit-on-hangup"]).output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert!(
        words.trim_end().lines().last().unwrap().starts_with("slamd: port missing: there is no /dev/nowhere"),
        "{words}"
    );
}
