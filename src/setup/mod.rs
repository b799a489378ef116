//! Finds out how a robot is built, and writes its configuration: a few seconds of movement, compared with the walls.
//!
//! Like the doctor, it has no port and no clock. It watches the robot with an [`Examination`] under the configuration that it believes in.
//! Whatever the drill or the walls contradict is corrected, and the robot is watched anew, until some metres agree.

mod ambiguity;
mod one_wheel;
mod robot;
mod take_back;
mod watch;

use crate::doctor::{Examination, Finding, Level};
use bytes::Bytes;
use one_wheel::OneWheel;
use robot::Wiring;
use slamd_core::{Config, Timestamp, config::RobotConfig};
use slamd_protocol::{FrameEncoder, Message, Setting};
use watch::MAX_PATH_M;

/// What the user has measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Radius of a driven wheel, metres.
    pub wheel_radius_m: Option<f64>,
    /// Distance between the driven wheels, metres.
    pub wheel_base_m: Option<f64>,
}

impl Measured {
    /// The robot with these measures, and the usual ones for the others.
    fn robot(&self) -> RobotConfig {
        let usual = RobotConfig::default();
        RobotConfig {
            wheel_radius_m: self.wheel_radius_m.unwrap_or(usual.wheel_radius_m),
            wheel_base_m: self.wheel_base_m.unwrap_or(usual.wheel_base_m),
            ..usual
        }
    }
}

/// How far a setup has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// It goes on.
    Busy,
    /// The configuration is known: the text of the file.
    Done(String),
    /// It cannot be found out: why, and what to do.
    Failed(String),
}

#[derive(Clone, Debug, PartialEq)]
enum Phase {
    /// Until board, ring and wiring are known.
    Board,
    /// The board takes over settings. Since when.
    Settings(Timestamp),
    /// The robot moves.
    Watch,
    /// A person turns one wheel. Since when.
    OneWheel(Timestamp, OneWheel),
    /// The board takes back its settings of before, after this end.
    TakeBack(Progress),
    Over(Progress),
}

/// Path and turning without a contradiction that are enough, metres and radians.
const ENOUGH_M: f64 = 5.0;
const ENOUGH_RAD: f64 = 6.3;
/// Time until a board must be known, and for its settings, seconds.
const BOARD_S: f64 = 20.0;
const SETTINGS_S: f64 = 3.0;
/// Period of the questions for the wiring, seconds, and their number.
const ASK_S: f64 = 0.5;
const MAX_ASKED: u32 = 4;

/// The setup of one robot.
pub struct Setup {
    config: Config,
    measured: Measured,
    baud: u32,
    port: String,
    examination: Examination,
    /// When the examination began: it counts from zero.
    begin: Timestamp,
    phase: Phase,
    encoder: FrameEncoder,
    asked: u32,
    ask_at: Timestamp,
    wiring: Option<Wiring>,
    wiring_before: Wiring,
    /// What the board's settings have been at any time: it keeps them until they are written.
    wiring_ever: Wiring,
    is_drilled: bool,
    has_person: bool,
    /// The person has been asked to turn a wheel, and has confirmed the wheels by it.
    is_asked: bool,
    is_told: bool,
    found: Vec<String>,
    found_at: Option<Timestamp>,
    rounds: usize,
    now: Timestamp,
    timeout_s: f64,
}

impl Setup {
    /// A setup of the board at a port that was just opened. It gives up after `timeout_s` seconds.
    #[must_use]
    pub fn new(measured: Measured, baud: u32, port: &str, timeout_s: f64) -> Self {
        let config = Config { robot: measured.robot(), ..Config::default() };
        let examination = Examination::new(&config, baud, port);
        Self {
            config,
            measured,
            baud,
            port: port.into(),
            examination,
            begin: Timestamp::default(),
            phase: Phase::Board,
            encoder: FrameEncoder::default(),
            asked: 0,
            ask_at: Timestamp::default(),
            wiring: None,
            wiring_before: Wiring::default(),
            wiring_ever: Wiring::default(),
            is_drilled: false,
            has_person: false,
            is_asked: false,
            is_told: false,
            found: Vec::new(),
            found_at: None,
            rounds: 0,
            now: Timestamp::default(),
            timeout_s,
        }
    }

    /// A person reads the instructions, and can be asked to do something with the robot.
    #[must_use]
    pub fn with_person(self, has_person: bool) -> Self {
        Self { has_person, ..self }
    }

    /// Takes bytes that were read.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        self.examination.received(self.own(at), bytes);
        self.advance(at);
    }

    /// Takes bytes that were written.
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        self.examination.sent(self.own(at), bytes);
    }

    /// Handles what is due up to `at`.
    pub fn run_until(&mut self, at: Timestamp) {
        self.examination.run_until(self.own(at));
        self.advance(at);
    }

    /// When [`Setup::run_until`] is next due.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        Timestamp::from_us(self.begin.us() + self.examination.next_deadline().us())
    }

    /// Frames to be written to the board since the last call.
    pub fn take_transmit(&mut self) -> Vec<Bytes> {
        let mut frames = self.examination.take_transmit();
        let has_board = self.examination.pipeline().board().hello().is_some();
        if self.phase == Phase::Board && has_board && self.wiring.is_none() && self.now >= self.ask_at {
            self.ask_at = after(self.now, ASK_S);
            self.asked += 1;
            for setting in Wiring::SETTINGS {
                let frame = self.encoder.encode(&Message::ConfigGet { key: setting.key() });
                frames.push(Bytes::copy_from_slice(&frame));
            }
        }
        frames
    }

    /// Another baud rate to try.
    pub fn take_baud(&mut self) -> Option<u32> {
        self.examination.take_baud()
    }

    /// How far it has come.
    #[must_use]
    pub const fn progress(&self) -> &Progress {
        match &self.phase {
            Phase::Over(progress) => progress,
            _ => &Progress::Busy,
        }
    }

    /// What was found so far, for people.
    #[must_use]
    pub fn found(&self) -> &[String] {
        &self.found
    }

    /// What to do now, with what was counted so far.
    #[must_use]
    pub fn instruction(&self) -> String {
        let drill = self.examination.drill();
        match &self.phase {
            Phase::Board => "listening to the board".into(),
            Phase::Settings(_) => "the board takes over its settings".into(),
            Phase::Watch if !self.is_drilled && self.rounds == 0 && drill.is_by_hand() => {
                // Until it moves, nobody knows whether it drives by itself.
                drill.instruction().replacen("30 cm:", "30 cm, unless it drives by itself:", 1)
            }
            Phase::Watch if self.is_drilled && self.examination.pipeline().is_range_unit_open() => {
                let (path_m, _) = drill.moved();
                format!(
                    "no reading lies beyond half a metre, which may be a wrong unit; push it straight ahead through the room, 2 m: {path_m:.1} m"
                )
            }
            Phase::Watch => {
                let (path_m, turned_rad) = drill.moved();
                if path_m > ENOUGH_M && turned_rad > ENOUGH_RAD {
                    return format!(
                        "waiting until the echoes agree with the map, keep driving past walls: {path_m:.0} m, it gives up at {MAX_PATH_M:.0} m"
                    );
                }
                format!(
                    "now drive it around the room, or push it: {:.1} of {ENOUGH_M:.0} m, {:.0} of {:.0} degrees",
                    path_m.min(ENOUGH_M),
                    turned_rad.min(ENOUGH_RAD).to_degrees(),
                    ENOUGH_RAD.to_degrees()
                )
            }
            Phase::OneWheel(_, wheels) => format!(
                "which wheel is which? Stop the robot, lift it, and turn only its LEFT wheel forward by half a turn: counted {:.0} cm",
                100.0 * wheels.counted_m()
            ),
            Phase::TakeBack(_) => "the board takes its settings of before back".into(),
            Phase::Over(_) => "done".into(),
        }
    }

    /// Warnings and problems of board and sensors, for people.
    #[must_use]
    pub fn complaints(&self) -> Vec<String> {
        let (findings, _) = self.examination.findings();
        let is_of_robot = |id: &str| id.starts_with("wheels.") || id.starts_with("model.") || id == "sensors.rate";
        let bad = findings.iter().filter(|finding| finding.level >= Level::Warning && !is_of_robot(finding.id));
        bad.map(|Finding { text, fix, .. }| fix.as_ref().map_or_else(|| text.clone(), |fix| format!("{text}: {fix}")))
            .collect()
    }

    fn own(&self, at: Timestamp) -> Timestamp {
        Timestamp::from_us(at.us().saturating_sub(self.begin.us()))
    }

    fn advance(&mut self, at: Timestamp) {
        self.now = at;
        match self.phase {
            Phase::Board => self.meet(at),
            Phase::Settings(since) => self.take_over(since, at),
            Phase::Watch => self.watch(at),
            Phase::OneWheel(since, _) => return self.see_wheel(since, at),
            Phase::TakeBack(_) => return self.await_settings(at),
            Phase::Over(_) => return,
        }
        if at.seconds() > self.timeout_s && !matches!(self.phase, Phase::Over(_)) {
            let (path_m, turned_rad) = self.examination.drill().moved();
            let turned_deg = turned_rad.to_degrees();
            if path_m > ENOUGH_M && turned_rad > ENOUGH_RAD {
                let verdict = self.verdict();
                let text = format!(
                    "after {:.0} s its echoes do not agree with the map that they draw; {verdict}",
                    self.timeout_s
                );
                return self.fail(text);
            }
            self.fail(format!(
                "after {:.0} s the robot has moved {path_m:.1} m and turned {turned_deg:.0} degrees since the last correction, which \
                 is too little to be sure: run it again and keep the robot moving, or give it more time with --timeout",
                self.timeout_s
            ));
        }
    }

    fn fail(&mut self, text: String) {
        self.phase = Phase::Over(Progress::Failed(text));
    }

    /// Waits for board, ring and wiring.
    fn meet(&mut self, at: Timestamp) {
        let values = Wiring::SETTINGS.map(|setting| self.examination.setting(setting));
        if let [Some(left), Some(right), Some(swapped)] = values {
            self.wiring = Some(Wiring::of_values([left, right, swapped]));
        }
        let pipeline = self.examination.pipeline();
        let is_asked = self.wiring.is_some() || self.asked >= MAX_ASKED && at > self.ask_at;
        let ticks = pipeline.board().ticks_per_turn();
        if let (Some(ring), Some(ticks), true, true) =
            (pipeline.ring(), ticks, is_asked, pipeline.counters().groups > 0)
        {
            self.wiring_before = self.wiring.unwrap_or_default();
            self.config.robot.ticks_per_turn = Some(ticks);
            self.config.ring.circle = robot::circle(ring);
            return self.begin_watch(at);
        }
        if at.seconds() > BOARD_S {
            let complaints = self.complaints();
            let first = complaints.first().cloned().unwrap_or_else(|| "the board does not say what it is".into());
            self.fail(format!("the board gives no readings; {first}"));
        }
    }

    /// Watches with the configuration of now, after the board has it.
    fn begin_watch(&mut self, at: Timestamp) {
        let wiring = self.wiring.unwrap_or_default();
        self.wiring_ever = self.wiring_ever.or(self.wiring_before);
        self.config.board = robot::settings(wiring, self.wiring_ever);
        self.wiring_ever = self.wiring_ever.or(wiring);
        self.examine_anew(at);
        self.found_at = None;
        self.phase = if self.config.board.is_empty() { Phase::Watch } else { Phase::Settings(at) };
    }

    /// Examines the board from now on, with the configuration of now.
    fn examine_anew(&mut self, at: Timestamp) {
        self.examination = Examination::new(&self.config, self.baud, &self.port);
        self.begin = at;
    }

    /// The configured settings that the board does not have.
    fn missing_settings(&self) -> impl Iterator<Item = Setting> {
        let differs = |(setting, value): &(Setting, i32)| self.examination.setting(*setting) != Some(*value);
        self.config.settings().filter(differs).map(|(setting, _)| setting)
    }

    /// Waits until the board has its settings, then watches from the beginning.
    fn take_over(&mut self, since: Timestamp, at: Timestamp) {
        let missing = self.missing_settings().next();
        match missing {
            None => {
                self.examine_anew(at);
                self.phase = Phase::Watch;
            }
            Some(setting) if at.seconds_since(since) > SETTINGS_S => {
                let (name, found) = (setting.name(), self.found.join("; "));
                self.fail(format!(
                    "{found}; but the board does not take board.{name}: exchange the plugs of the encoders, or their channels A and B \
                     for a wheel that counts backwards, then run it again"
                ));
            }
            Some(_) => {}
        }
    }
}

fn after(at: Timestamp, seconds: f64) -> Timestamp {
    at + std::time::Duration::from_secs_f64(seconds)
}
