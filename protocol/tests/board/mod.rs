//! The firmware's core on a simulated board.

#![allow(dead_code, reason = "each test uses its part")]

use slamd_protocol::{FrameDecoder, FrameEncoder, Message, Setting};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

/// The simulated board, built once.
static BOARD: LazyLock<PathBuf> = LazyLock::new(|| {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("paper_board-{}", std::process::id()));
    let built = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsanitize=undefined", "-fno-sanitize-recover", "-I"])
        .args([
            here.join("firmware/src"),
            here.join("firmware/src/slamd_ring.c"),
            here.join("firmware/src/slamd_motors.c"),
            here.join("tests/c/port_host.c"),
        ])
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .status()
        .expect("a C compiler: install build-essential");
    assert!(built.success());
    program
});

/// The host's messages, and the events around the board.
pub(crate) struct Script {
    text: String,
    encoder: FrameEncoder,
}

impl Script {
    pub(crate) fn boot(at_us: u32) -> Self {
        Self { text: format!("boot {at_us}\n"), encoder: FrameEncoder::new() }
    }

    pub(crate) fn then(mut self, line: &str) -> Self {
        self.text.push_str(line);
        self.text.push('\n');
        self
    }

    pub(crate) fn hear(mut self, bytes: &[u8]) -> Self {
        write!(self.text, "hear {} ", bytes.len()).unwrap();
        for byte in bytes {
            write!(self.text, "{byte:02x}").unwrap();
        }
        self.then("\nrun 10000")
    }

    pub(crate) fn say(mut self, message: &Message) -> Self {
        let frame = self.encoder.encode(message);
        self.hear(&frame)
    }

    pub(crate) fn set(self, setting: Setting, value: i32) -> Self {
        self.say(&Message::ConfigSet { key: setting.key(), value })
    }

    pub(crate) fn messages(self) -> Vec<Message> {
        let mut child = Command::new(&*BOARD).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(self.text.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut decoder = FrameDecoder::new();
        let mut messages = Vec::new();
        for hex in output.stdout.chunks(2) {
            let byte = u8::from_str_radix(str::from_utf8(hex).unwrap(), 16).unwrap();
            if let Some(frame) = decoder.push(byte) {
                messages.push(Message::parse(frame.kind, frame.payload).unwrap());
            }
        }
        assert_eq!((decoder.counters().crc_errors, decoder.counters().malformed), (0, 0));
        messages
    }
}
