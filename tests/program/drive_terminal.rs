//! `slamd drive` on a pseudo-terminal: the robot turns while a key is held, and stands when its repeats stop.

#![allow(clippy::unwrap_used, reason = "a test may")]

use crate::monitor_terminal::Watched;
use slamd_testkit::driving::STANDSTILL;
use slamd_testkit::mock_port::Board;
use slamd_testkit::served::{SOON, Served};
use std::process::Command;
use std::time::{Duration, Instant};

/// A repeating key is held for so long after its last repeat.
const REPEAT: Duration = Duration::from_millis(200);
/// A busy machine reads keys late.
const PATIENCE: Duration = Duration::from_millis(500);

#[test]
#[expect(clippy::disallowed_methods, reason = "keys are held in real time")]
fn the_robot_turns_while_a_key_is_held() {
    let mut served = Served::new(&["--socket", "api.sock", "--drive"]);
    let plugged = served.plug_in(Board::standing(1));
    served.daemon.expect("link: streaming", SOON);
    let socket = served.folder.path().join("api.sock");
    let mut keyboard = Watched::run(&["drive", "--socket", socket.to_str().unwrap()]);
    keyboard.expect_text("rad/s");
    let hold = |keyboard: &mut Watched, key: &str| {
        for _ in 0..40 {
            keyboard.press(key);
            std::thread::sleep(Duration::from_millis(40));
        }
        Instant::now()
    };
    let released = hold(&mut keyboard, "d");
    keyboard.expect_text("motors: driving");
    assert!(plugged.peak_m_s() > 0.05, "{} m/s", plugged.peak_m_s());
    std::thread::sleep(Duration::from_secs(2));
    let turned = plugged.turned_after(released);
    assert!(turned <= REPEAT + STANDSTILL + plugged.late() + PATIENCE, "{turned:?}");
    // Killed with the key held.
    hold(&mut keyboard, "\x1b[D");
    let moment = Instant::now();
    drop(keyboard);
    std::thread::sleep(Duration::from_secs(2));
    let turned = plugged.turned_after(moment);
    assert!(turned <= STANDSTILL + plugged.late() + PATIENCE, "{turned:?}");
    let mut quits = Watched::run(&["drive", "--socket", socket.to_str().unwrap()]);
    quits.expect_text("rad/s");
    quits.press("q");
    assert_eq!(quits.end().code(), Some(0), "{}", quits.text());
    drop(plugged);
    served.daemon.end();
}

#[test]
fn without_a_terminal_or_a_slamd_it_says_what_to_do() {
    let output = Command::new(env!("CARGO_BIN_EXE_slamd")).args(["drive", "--socket", "nowhere"]).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(64) && text.contains("standard input is no terminal"), "{text}");
    let mut nobody = Watched::run(&["drive", "--socket", "nowhere"]);
    assert_eq!(nobody.end().code(), Some(69));
    assert!(nobody.text().contains("--socket --drive` first"), "{}", nobody.text());
}
