//! `slamd drive`: the robot follows the keys that are held in this terminal.

use super::{Failure, Kind, terminal};
use crate::api;
use crate::drive::Twist;
use crate::drive::keys::{Key, Keys};
use clap::Args;
use ratatui::crossterm::event::{
    self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, KeyboardEnhancementFlags, PopKeyboardEnhancementFlags,
    PushKeyboardEnhancementFlags,
};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode, supports_keyboard_enhancement};
use slamd_core::Timestamp;
use std::io::{self, BufRead as _, BufReader, IsTerminal as _, Write as _};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const HELP: &str = "Examples:
  slamd --port auto --socket --drive     in one terminal
  slamd drive                            in another one, or over SSH

Keys, while they are held: arrows or w, a, s, d drive and turn; space stops; + and - change the speed; q and Esc quit.
Most terminals do not tell that a key is released: the robot stops when its repeats stop, within 0.4 s, and after a
single short press within 0.9 s. It stops, too, when this program or its connection ends.";

/// Drive the robot of a running `slamd --socket --drive` with the keyboard.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct DriveArgs {
    /// The socket of that slamd; without it slamd.sock in XDG_RUNTIME_DIR.
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Speed forward and backward at first, metres per second. slamd limits it: drive.max_speed_m_s.
    #[arg(long, value_name = "M/S", default_value_t = 0.15, value_parser = speed)]
    speed: f64,
    /// Turn rate at first, radians per second. slamd limits it: drive.max_turn_rad_s.
    #[arg(long, value_name = "RAD/S", default_value_t = 0.8, value_parser = speed)]
    turn: f64,
}

/// Period of the commands, and how long one holds.
const PERIOD: Duration = Duration::from_millis(100);
const FOR_MS: u16 = 250;
/// One step of + and -.
const STEP: f64 = 1.25;

impl DriveArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        if !io::stdin().is_terminal() {
            return Err(Failure::new(
                Kind::Usage,
                "standard input is no terminal: `slamd drive` reads keys; programs use ?DRIVE (docs/drive.md)",
            ));
        }
        let path = super::api::socket_path(self.socket.clone())?;
        let mut stream = UnixStream::connect(&path).map_err(|error| unreachable_socket(&path, &error))?;
        let answers = listen(&stream).map_err(|error| unreachable_socket(&path, &error))?;
        let full = Twist { forward_m_s: self.speed, turn_rad_s: self.turn };
        let screen = RawScreen::open()
            .map_err(|error| Failure::new(Kind::Unavailable, format!("this terminal has no raw mode: {error}")))?;
        let driven = drive(&mut stream, &answers, full);
        // The robot stops whatever happened; a connection that is gone stops it, too.
        let _ = writeln!(stream, "?STOP;");
        drop(screen);
        terminal::tell("");
        driven
    }
}

/// Reads keys and sends commands until the user quits.
#[expect(clippy::disallowed_methods, reason = "keys are held in real time")]
fn drive(stream: &mut UnixStream, answers: &Receiver<String>, mut full: Twist) -> Result<(), Failure> {
    let begin = Instant::now();
    let now = || Timestamp::default() + begin.elapsed();
    let (mut keys, mut is_driving, mut said, mut next) = (Keys::default(), false, String::new(), Instant::now());
    let gone = |error: io::Error| Failure::new(Kind::Unavailable, format!("slamd is gone: {error}"));
    show(full, "");
    loop {
        let wait = next.saturating_duration_since(Instant::now());
        if event::poll(wait).map_err(gone)?
            && let Event::Key(pressed) = event::read().map_err(gone)?
        {
            match meaning(pressed) {
                Meaning::Quit => return Ok(()),
                Meaning::Key(key) if pressed.kind == KeyEventKind::Release => keys.released(key),
                Meaning::Key(key) => keys.pressed(key, now()),
                Meaning::Scale(factor) if pressed.kind != KeyEventKind::Release => {
                    full.forward_m_s *= factor;
                    full.turn_rad_s *= factor;
                    show(full, &said);
                }
                Meaning::Scale(_) | Meaning::None => {}
            }
            // A stop is not late by a period.
            if !(is_driving && keys.twist(full, now()).is_none()) {
                continue;
            }
        }
        next = Instant::now() + PERIOD;
        match keys.twist(full, now()) {
            Some(twist) => {
                let Twist { forward_m_s, turn_rad_s } = twist;
                let wish = api::DriveRequest { forward_m_s, turn_rad_s, for_ms: FOR_MS, autonomous: false };
                writeln!(stream, "?DRIVE={};", serde_json::to_string(&wish).unwrap_or_default()).map_err(gone)?;
                is_driving = true;
            }
            None if std::mem::take(&mut is_driving) => writeln!(stream, "?STOP;").map_err(gone)?,
            // A client that says nothing is dropped.
            None => writeln!(stream, "?VERSION;").map_err(gone)?,
        }
        loop {
            match answers.try_recv() {
                Ok(line) => {
                    if let Some(text) = words(&line).filter(|text| *text != said) {
                        said = text;
                        show(full, &said);
                    }
                }
                Err(std::sync::mpsc::TryRecvError::Empty) => break,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => {
                    let ended = io::Error::new(io::ErrorKind::UnexpectedEof, "the connection ended");
                    return Err(gone(ended));
                }
            }
        }
    }
}

/// What a key means.
enum Meaning {
    Key(Key),
    Scale(f64),
    Quit,
    None,
}

fn meaning(key: KeyEvent) -> Meaning {
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Meaning::Quit,
        KeyCode::Up | KeyCode::Char('w') => Meaning::Key(Key::Ahead),
        KeyCode::Down | KeyCode::Char('s') => Meaning::Key(Key::Back),
        KeyCode::Left | KeyCode::Char('a') => Meaning::Key(Key::Left),
        KeyCode::Right | KeyCode::Char('d') => Meaning::Key(Key::Right),
        KeyCode::Char(' ') => Meaning::Key(Key::Stop),
        KeyCode::Char('+') => Meaning::Scale(STEP),
        KeyCode::Char('-') => Meaning::Scale(1.0 / STEP),
        KeyCode::Esc | KeyCode::Char('q') => Meaning::Quit,
        _ => Meaning::None,
    }
}

/// What an answer says to the person at the keyboard; none where it is no news.
fn words(line: &str) -> Option<String> {
    let line: serde_json::Value = serde_json::from_str(line).ok()?;
    match line.get("class")?.as_str()? {
        "DRIVE" => Some(format!("motors: {}", line.get("motors")?.as_str().unwrap_or("not heard of yet"))),
        "ERROR" => line.get("message")?.as_str().map(terminal::plain),
        _ => None,
    }
}

/// One line that is written over.
fn show(full: Twist, said: &str) {
    let text: String = said.chars().take(90).collect();
    let mut out = io::stderr();
    let Twist { forward_m_s, turn_rad_s } = full;
    let _ = write!(out, "\r\x1b[K{forward_m_s:.2} m/s, {turn_rad_s:.2} rad/s  {text}");
    let _ = out.flush();
}

/// The lines of slamd, read by a thread of their own.
fn listen(stream: &UnixStream) -> io::Result<Receiver<String>> {
    let lines = BufReader::new(stream.try_clone()?);
    let (sender, receiver) = channel();
    std::thread::Builder::new().name("answers".into()).spawn(move || {
        for line in lines.lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    })?;
    Ok(receiver)
}

fn unreachable_socket(path: &Path, error: &io::Error) -> Failure {
    let text = format!(
        "{}: {error}: start `slamd --port PORT --socket --drive` first, or name its socket with --socket PATH",
        path.display()
    );
    Failure::new(Kind::Unavailable, text)
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| (0.01..=5.0).contains(speed));
    speed.ok_or_else(|| "it must be from 0.01 to 5".into())
}

/// Raw mode, and told releases where the terminal can; restored when it is dropped.
struct RawScreen {
    tells_releases: bool,
}

impl RawScreen {
    fn open() -> io::Result<Self> {
        enable_raw_mode()?;
        let tells_releases = supports_keyboard_enhancement().unwrap_or(false)
            && execute!(
                io::stdout(),
                PushKeyboardEnhancementFlags(
                    KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES | KeyboardEnhancementFlags::REPORT_EVENT_TYPES
                )
            )
            .is_ok();
        Ok(Self { tells_releases })
    }
}

impl Drop for RawScreen {
    fn drop(&mut self) {
        if self.tells_releases {
            let _ = execute!(io::stdout(), PopKeyboardEnhancementFlags);
        }
        let _ = disable_raw_mode();
    }
}
