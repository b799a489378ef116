//! A mock serial port: a board on a pseudo-terminal behind a bad cable, seeded.
//!
//! A pseudo-terminal holds its writer back where a UART loses bytes, and passes any baud rate; here bytes that nobody reads in time
//! are lost, and both directions are garbled unless the host has set the board's baud rate.

pub mod daemon;
pub mod replug;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use slamd_capture::Record;
use slamd_core::Timestamp;
use slamd_protocol::{FrameEncoder, Hello, Message, Text};
use slamd_sim::link::LinkFaults;
use slamd_sim::random::{Random, Stream};
use slamd_sim::simulation::{SimConfig, Simulation};
use slamd_sim::world::World;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What sits at the other end.
pub enum Board {
    /// A simulated robot.
    Robot(Box<Simulation>),
    /// The same, restarting every so often: its supply breaks down.
    Restarting(Box<Simulation>, Duration),
    /// Another firmware, which prints text.
    Text,
    /// Nothing that speaks.
    Silent,
    /// Receive and transmit wires touch.
    Echo,
    /// A board that speaks another major version of the protocol.
    Speaks(u8),
}

impl Board {
    /// A robot in the flat, every random number from `seed`.
    pub fn robot(seed: u64) -> Self {
        Self::Robot(Box::new(simulation(seed, LinkFaults::default(), LONG_S)))
    }

    /// A robot in the flat that stands until the host drives it.
    pub fn standing(seed: u64) -> Self {
        Self::Robot(Box::new(simulation(seed, LinkFaults::default(), LONG_S).driven_by_host()))
    }

    /// The same with broken sensors, as `slamd simulate --fault` takes them.
    pub fn broken(seed: u64, faults: &[&str]) -> Self {
        let faults = faults.iter().map(|fault| fault.parse().expect("a fault")).collect();
        Self::Robot(Box::new(Simulation::new(SimConfig { faults, ..drive(seed, LinkFaults::default(), LONG_S) })))
    }
}

/// Longer than any test, seconds.
pub const LONG_S: f64 = 36_000.0;

/// A drive through the flat.
pub fn simulation(seed: u64, link: LinkFaults, duration_s: f64) -> Simulation {
    Simulation::new(drive(seed, link, duration_s))
}

/// What makes it.
pub fn drive(seed: u64, link: LinkFaults, duration_s: f64) -> SimConfig {
    SimConfig { link, ..SimConfig::usual(World::named("flat").expect("a built-in world"), seed, duration_s, 32) }
}

/// A board and how long it has been running, in or out of the host.
pub struct Device {
    board: Board,
    /// Bits per second; at any other rate both sides hear noise.
    baud: u32,
    ran: Duration,
    boots_at: Option<Duration>,
    encoder: FrameEncoder,
    random: Random,
    /// A print that its firmware sends between frames.
    print: &'static [u8],
}

impl Device {
    pub fn new(board: Board, seed: u64) -> Self {
        let random = Random::new(seed, Stream::Link);
        Self {
            board,
            baud: 115_200,
            ran: Duration::ZERO,
            boots_at: None,
            encoder: FrameEncoder::new(),
            random,
            print: b"",
        }
    }

    /// The board's firmware prints this text three times a second, between frames.
    pub fn with_text(self, print: &'static [u8]) -> Self {
        Self { print, ..self }
    }

    pub fn at_baud(self, baud: u32) -> Self {
        Self { baud, ..self }
    }

    /// The board gets its supply from the host: it boots, and speaks, this long after it is plugged in.
    pub fn boots_in(&mut self, boot: Duration) {
        self.boots_at = Some(self.ran + boot);
    }

    /// Bytes that the board sends up to now.
    fn speak(&mut self, ran: Duration) -> Vec<u8> {
        let before = std::mem::replace(&mut self.ran, ran);
        let has_passed =
            |every: Duration| before.as_millis() / every.as_millis() != ran.as_millis() / every.as_millis();
        let mut bytes = Vec::new();
        match &mut self.board {
            Board::Silent | Board::Echo => {}
            Board::Text if has_passed(Duration::from_millis(100)) => bytes.extend(b"Ping: 123 cm  Pong: 45 cm\r\n"),
            Board::Text => {}
            Board::Speaks(major) if has_passed(Duration::from_millis(500)) => {
                bytes.extend(self.encoder.encode(&Message::Hello(hello(*major))));
            }
            Board::Speaks(_) => {}
            Board::Robot(simulation) => {
                bytes = spoken(simulation, ran);
                if self.boots_at.is_some() {
                    bytes.clear();
                }
                if self.boots_at.take_if(|boots_at| *boots_at <= ran).is_some() {
                    simulation.restart_board();
                }
            }
            Board::Restarting(simulation, every) => {
                bytes = spoken(simulation, ran);
                if has_passed(*every) {
                    simulation.restart_board();
                }
            }
        }
        if has_passed(Duration::from_millis(300)) {
            bytes.extend(self.print);
        }
        bytes
    }

    /// The faster wheel's speed now, metres per second; 0 for a device without wheels.
    pub fn wheel_speed_m_s(&self) -> f64 {
        match &self.board {
            Board::Robot(simulation) | Board::Restarting(simulation, _) => {
                simulation.wheel_speeds_m_s().iter().fold(0.0, |fastest, speed| speed.abs().max(fastest))
            }
            _ => 0.0,
        }
    }

    /// Runs on without a host for `span`; how long the wheels went on turning.
    pub fn runs_out(&mut self, span: Duration) -> Duration {
        let (begin, mut turned) = (self.ran, Duration::ZERO);
        while self.ran < begin + span {
            self.speak(self.ran + Duration::from_millis(5));
            if self.wheel_speed_m_s() > 0.0 {
                turned = self.ran - begin;
            }
        }
        turned
    }

    /// Passes bytes to the board and returns its immediate answer.
    fn hear(&mut self, bytes: &[u8]) -> Vec<u8> {
        match &mut self.board {
            Board::Robot(simulation) | Board::Restarting(simulation, _) => {
                simulation.hear(Timestamp::default() + self.ran, bytes);
                Vec::new()
            }
            Board::Echo => bytes.to_vec(),
            _ => Vec::new(),
        }
    }

    /// What the wrong baud rate makes of bytes.
    fn garble(&mut self, bytes: &mut [u8]) {
        bytes.iter_mut().for_each(|byte| *byte = self.random.bits().to_le_bytes()[0] | 1);
    }
}

fn spoken(simulation: &mut Simulation, ran: Duration) -> Vec<u8> {
    let mut spoken = Vec::new();
    while let Some(record) = simulation.poll(Timestamp::default() + ran) {
        if let Record::Received { bytes, .. } = record {
            spoken.extend(bytes);
        }
    }
    spoken
}

/// What a board of this major version says of itself.
pub fn hello(major: u8) -> Hello {
    Hello {
        major,
        minor: 0,
        boot_id: 7,
        tick_hz: 1_000_000,
        sensors: 32,
        ticks_per_turn: 1440,
        capabilities: 0,
        config_crc: 0,
        uid: *b"slamdsim",
        board: Text::new("stranger"),
        firmware: Text::new("9.9"),
    }
}

/// The board's end of a pseudo-terminal. No program started by a test inherits it: the line would never hang up.
pub struct Terminal {
    master: File,
    /// The host's end.
    pub path: PathBuf,
}

impl Terminal {
    pub fn open() -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a pseudo-terminal");
        grantpt(&master).expect("granted");
        unlockpt(&master).expect("unlocked");
        let path = ptsname(&master, Vec::new()).expect("a name").into_string().expect("plain").into();
        let mut modes = tcgetattr(&master).expect("a terminal");
        modes.make_raw();
        tcsetattr(&master, OptionalActions::Now, &modes).expect("a terminal");
        rustix::io::ioctl_fionbio(&master, true).expect("never waits");
        Self { master: master.into(), path }
    }

    /// What the host has written by now.
    pub fn read(&mut self) -> Vec<u8> {
        let mut heard = [0; 256];
        let count = self.master.read(&mut heard).unwrap_or(0);
        heard[..count].to_vec()
    }

    /// Hands bytes to the host; how many it had no room for.
    pub fn write(&mut self, bytes: &[u8]) -> usize {
        bytes.len() - self.master.write(bytes).unwrap_or(0)
    }

    /// The rate that the host has set for its end.
    fn baud(&self) -> Option<u32> {
        tcgetattr(&self.master).ok().map(|modes| modes.output_speed())
    }
}

/// What the thread that plays the board shares with the test.
#[derive(Default)]
struct Shared {
    end: AtomicBool,
    stalled: AtomicBool,
    lost_bytes: AtomicU64,
    /// When a wheel last turned and the longest time between two looks at the line, microseconds since the device was plugged in.
    turned_us: AtomicU64,
    late_us: AtomicU64,
    /// The highest speed of a wheel so far, micrometres per second.
    peak_um_s: AtomicU64,
}

/// A device plugged in under a name.
pub struct Plugged {
    name: PathBuf,
    shared: Arc<Shared>,
    begin: Instant,
    thread: Option<JoinHandle<Device>>,
}

impl Plugged {
    /// Plugs a device in: it appears as a pseudo-terminal that `name` links to.
    pub fn new(name: &Path, device: Device) -> Self {
        Self::at(Terminal::open(), name, device)
    }

    /// The same at a terminal opened before.
    #[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
    pub fn at(terminal: Terminal, name: &Path, device: Device) -> Self {
        std::os::unix::fs::symlink(&terminal.path, name).expect("a free name");
        let (shared, begin) = (Arc::new(Shared::default()), Instant::now());
        let thread = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || play(terminal, device, &shared, begin))
        };
        Self { name: name.into(), shared, begin, thread: Some(thread) }
    }

    /// Pulls the cable; the device keeps running without a host.
    pub fn unplug(mut self) -> Device {
        self.pull().expect("it was plugged in")
    }

    /// The line falls dead for as long as this is so; what the board sends meanwhile is lost.
    pub fn stall(&self, is_stalled: bool) {
        self.shared.stalled.store(is_stalled, Ordering::Relaxed);
    }

    /// Bytes lost because the host did not read in time.
    pub fn lost_bytes(&self) -> u64 {
        self.shared.lost_bytes.load(Ordering::Relaxed)
    }

    /// How long after `moment` a wheel last turned, by the device's clock.
    pub fn turned_after(&self, moment: Instant) -> Duration {
        let turned = Duration::from_micros(self.shared.turned_us.load(Ordering::Relaxed));
        (self.begin + turned).saturating_duration_since(moment)
    }

    /// The longest time between two looks at the line so far: the machine was busy.
    pub fn late(&self) -> Duration {
        Duration::from_micros(self.shared.late_us.load(Ordering::Relaxed))
    }

    /// The highest speed of a wheel so far, metres per second.
    pub fn peak_m_s(&self) -> f64 {
        1e-6 * self.shared.peak_um_s.load(Ordering::Relaxed) as f64
    }

    fn pull(&mut self) -> Option<Device> {
        let _ = std::fs::remove_file(&self.name);
        self.shared.end.store(true, Ordering::Relaxed);
        self.thread.take().and_then(|thread| thread.join().ok())
    }
}

impl Drop for Plugged {
    fn drop(&mut self) {
        self.pull();
    }
}

/// Notes how the wheels turn.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "microseconds, and micrometres per second")]
fn note(shared: &Shared, device: &Device, now: Duration, before: Duration) {
    let (speed_m_s, us) = (device.wheel_speed_m_s(), now.as_micros() as u64);
    if speed_m_s > 0.0 {
        shared.turned_us.store(us, Ordering::Relaxed);
    }
    shared.peak_um_s.fetch_max((1e6 * speed_m_s) as u64, Ordering::Relaxed);
    shared.late_us.fetch_max((now - before).as_micros() as u64, Ordering::Relaxed);
}

#[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
fn play(mut terminal: Terminal, mut device: Device, shared: &Shared, begin: Instant) -> Device {
    let (ran, mut looked) = (device.ran, begin.elapsed());
    while !shared.end.load(Ordering::Relaxed) {
        let now = begin.elapsed();
        let mut spoken = device.speak(ran + now);
        note(shared, &device, now, std::mem::replace(&mut looked, now));
        let mut heard = terminal.read();
        if heard.is_empty() {
            std::thread::sleep(Duration::from_millis(1));
        }
        if terminal.baud().is_some_and(|baud| baud != device.baud) {
            device.garble(&mut spoken);
            heard.clear();
        }
        spoken.extend(device.hear(&heard));
        if !shared.stalled.load(Ordering::Relaxed) && !spoken.is_empty() {
            let lost = terminal.write(&spoken);
            shared.lost_bytes.fetch_add(lost as u64, Ordering::Relaxed);
        }
    }
    device
}
