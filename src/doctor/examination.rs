//! The examination of a board: collects evidence from the traffic.

use super::clock::ClockEvidence;
use super::drill::Drill;
use super::drill_findings;
use super::finding::{Finding, Level, Report};
use super::line::LineEvidence;
use super::sensors::SensorEvidence;
use super::troubles::Troubles;
use super::wheels::{WheelEvidence, metres_per_tick};
use bytes::Bytes;
use slamd_core::{
    Config, Driver, FaultKind, Input, ModelEvent, ModelState, Pipeline, Record, SensorState, SessionState, Timestamp,
    Update,
    link::{Link, Remedy},
};
use slamd_protocol::{DELIMITER, FrameDecoder, Message, Setting};

/// An examination of a board: takes the same inputs as a session and gives its findings at the end.
pub struct Examination {
    config: Config,
    driver: Driver,
    link: Link,
    decoder: FrameDecoder,
    outputs: Outputs,
    sensors: SensorEvidence,
    wheels: WheelEvidence,
    clock: ClockEvidence,
    drill: Drill,
    is_recording: bool,
    settings: [Option<i32>; Setting::ALL.len()],
    restarts: u64,
}

/// Outputs of the pipeline.
struct Outputs {
    line: LineEvidence,
    transmit: Vec<Bytes>,
    state: SessionState,
}

impl Examination {
    /// An examination of a board whose port was just opened at `baud`.
    #[must_use]
    pub fn new(config: &Config, baud: u32, port: &str) -> Self {
        let pipeline = slamd_paper::pipeline(config, slamd_core::Start::Fresh)
            .expect("a fresh start has no saved state that could be refused");
        let mut driver = Driver::new(pipeline);
        driver.keep_sweeps();
        let mut link = Link::new(baud);
        link.opened(Timestamp::default(), port, &driver.reception());
        Self {
            config: config.clone(),
            driver,
            link,
            decoder: FrameDecoder::new(),
            outputs: Outputs { line: LineEvidence::new(baud), transmit: Vec::new(), state: SessionState::default() },
            sensors: SensorEvidence::default(),
            wheels: WheelEvidence::new(&config.robot),
            clock: ClockEvidence::default(),
            drill: Drill::new(config.robot.wheel_base_m),
            is_recording: false,
            settings: [None; Setting::ALL.len()],
            restarts: 0,
        }
    }

    /// Takes a record of a capture. The capture holds the frames that were really sent, so new ones are discarded.
    pub fn feed(&mut self, record: &Record) {
        self.is_recording = true;
        match record {
            Record::Received { at, bytes } => self.received(*at, bytes),
            Record::Sent { at, bytes } => self.sent(*at, bytes),
            Record::Opened { at } => self.opened(*at),
            Record::Truth { .. } => {}
        }
        self.outputs.transmit.clear();
    }

    /// The port was opened again.
    pub fn opened(&mut self, at: Timestamp) {
        let at = self.run_until(at);
        self.decoder.push(DELIMITER);
        self.wheels.restart();
        self.handle(Input::Opened { at });
    }

    /// Takes bytes that were read.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        let at = self.run_until(at);
        self.handle(Input::Received { at, bytes });
        self.outputs.line.received(at, bytes.len());
        self.link.heard(at, bytes, &self.driver.reception());
        self.take_link_changes();
        let counters = self.driver.pipeline().counters();
        if counters.restarts > self.restarts {
            self.restarts = counters.restarts;
            self.wheels.restart();
            self.clock.restart();
            self.sensors.restart();
            self.outputs.line.restart();
        }
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            if let Ok(message) = Message::parse(frame.kind, frame.payload) {
                self.message(&message);
            }
        }
    }

    /// Takes bytes that were written.
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        let at = self.run_until(at);
        self.handle(Input::Sent { at, bytes });
        self.clock.sent(at, bytes);
    }

    /// Handles the deadlines of the pipeline and of the link up to `at`; gives `at`, or the last input's time where that is later.
    pub fn run_until(&mut self, at: Timestamp) -> Timestamp {
        while let Some(deadline) = self.link.deadline().filter(|deadline| *deadline <= at) {
            let deadline = self.advance(deadline);
            self.link.tick(deadline, &self.driver.reception());
            self.take_link_changes();
        }
        self.advance(at)
    }

    /// When [`Examination::run_until`] is next due.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.link.deadline().into_iter().fold(self.driver.next_deadline(), Ord::min)
    }

    /// Frames to be written to the board since the last call.
    pub fn take_transmit(&mut self) -> Vec<Bytes> {
        std::mem::take(&mut self.outputs.transmit)
    }

    /// Another baud rate to try.
    pub fn take_baud(&mut self) -> Option<u32> {
        match self.link.take_remedy()? {
            Remedy::Baud(baud) => Some(baud),
            Remedy::Reopen => None,
        }
    }

    /// True once a valid frame was received.
    #[must_use]
    pub fn has_frames(&self) -> bool {
        self.driver.pipeline().counters().frames > 0
    }

    /// The pipeline, to read its state.
    #[must_use]
    pub const fn pipeline(&self) -> &Pipeline {
        self.driver.pipeline()
    }

    /// What the pipeline's events add up to.
    #[must_use]
    pub const fn state(&self) -> &SessionState {
        &self.outputs.state
    }

    /// The drill so far.
    #[must_use]
    pub const fn drill(&self) -> &Drill {
        &self.drill
    }

    /// The board's value of a setting, if it has reported it.
    #[must_use]
    pub fn setting(&self, setting: Setting) -> Option<i32> {
        self.settings.get(usize::from(setting.key()).checked_sub(1)?).copied().flatten()
    }

    /// The findings, and each sensor's statistics.
    #[must_use]
    pub fn findings(&self) -> (Vec<Finding>, Vec<super::SensorStatistics>) {
        let counters = self.driver.pipeline().counters();
        let troubles = Troubles::new(self.driver.pipeline().troubles());
        let board = self.driver.pipeline().board();
        let mut findings = self.outputs.line.findings(&counters, board, self.link.baud(), &troubles);
        let answers = counters.frames > counters.echoed && !self.driver.pipeline().board().is_refused();
        if !answers {
            if self.is_recording {
                findings = findings.into_iter().map(drill_findings::of_recording).collect();
            }
            return (findings, Vec::new());
        }
        let sensors = match (self.driver.pipeline().board().hello(), self.driver.pipeline().ring()) {
            (_, Some(ring)) => ring.len(),
            (Some(hello), None) => usize::from(hello.sensors),
            (None, None) => 0,
        };
        let us_per_number = self.driver.pipeline().flight_factor() * self.config.ring.range_scale;
        let statistics = self.sensors.statistics(sensors, self.driver.pipeline().ring(), us_per_number);
        let path_m = self.wheels.path_m(&self.config.robot, self.driver.pipeline().board());
        let mut of_sensors = self.sensors.findings(
            &statistics,
            path_m,
            self.config.ring.max_range_m,
            self.setting(Setting::SlotUs),
            self.driver.pipeline().ring(),
            &troubles,
        );
        if !self.is_recording && !self.clock.has_answers() {
            of_sensors.iter_mut().filter(|finding| finding.id == "sensors.silent").for_each(deaf);
        }
        let is_ring_known = troubles.is_ring_known();
        if is_ring_known {
            findings.extend(of_sensors);
            findings.extend(noisy(self.driver.pipeline().states()));
        }
        let of_wheels = self.wheels.findings(&self.config.robot, self.driver.pipeline().board(), |setting| {
            self.setting(setting).or_else(|| {
                self.config.settings().find(|(configured, _)| *configured == setting).map(|(_, value)| value)
            }) == Some(1)
        });
        let models = self.outputs.state.models().iter().filter(|event| event.state != ModelState::Resolved);
        let models: Vec<Finding> = models.filter(|_| is_ring_known).map(model).collect();
        let of_drill = if models.is_empty() && is_ring_known { self.of_drill(&of_wheels) } else { Vec::new() };
        // What the walls confirm replaces what the wheels alone suggest.
        findings.extend(of_wheels.into_iter().filter(|finding| of_drill.iter().all(|other| other.id != finding.id)));
        findings.extend(of_drill);
        findings.extend(models);
        // An imported recording has no board that could be asked for its time.
        if !(self.is_recording && board.description().starts_with("imported ")) {
            findings.extend(self.clock.findings());
        }
        if self.is_recording {
            findings = findings.into_iter().map(drill_findings::of_recording).collect();
        }
        (findings, statistics)
    }

    /// What the drill shows; nothing where the wheels' own findings say that they mislead.
    fn of_drill(&self, of_wheels: &[Finding]) -> Vec<Finding> {
        let is_misled = of_wheels.iter().any(|finding| {
            ["wheels.dead", "wheels.left_reversed", "wheels.right_reversed", "wheels.still"].contains(&finding.id)
        });
        match self.driver.pipeline().ring() {
            Some(ring) if !is_misled => {
                let robot = &self.config.robot;
                let ticks = robot.ticks_per_turn.or_else(|| self.driver.pipeline().board().ticks_per_turn());
                drill_findings::findings(&self.drill.result(ring), robot, ticks)
            }
            _ => Vec::new(),
        }
    }

    /// The findings as a report.
    #[must_use]
    pub fn report(&self) -> Report {
        let (findings, sensors) = self.findings();
        Report::new(findings, sensors)
    }

    fn message(&mut self, message: &Message) {
        match message {
            Message::Sonar(sonar) => {
                let t_us = self.driver.pipeline().stamp_us(sonar.t_us);
                self.sensors.sonar(sonar, t_us);
                self.counts(t_us, sonar.left_ticks, sonar.right_ticks);
            }
            Message::Encoder(encoder) => {
                let t_us = self.driver.pipeline().stamp_us(encoder.t_us);
                self.counts(t_us, encoder.left_ticks, encoder.right_ticks);
            }
            Message::Status(status) => {
                self.outputs.line.status(status);
                self.sensors.status(status);
            }
            Message::TimeResponse { token, rx_us, tx_us } => {
                self.clock.answered(self.driver.now(), *token, *rx_us, *tx_us)
            }
            Message::ConfigValue { key, value } => {
                let setting = usize::from(*key).checked_sub(1).and_then(|index| self.settings.get_mut(index));
                if let Some(setting) = setting {
                    *setting = Some(*value);
                }
            }
            _ => {}
        }
    }

    fn counts(&mut self, t_us: u32, left: i32, right: i32) {
        let metres_per_tick = metres_per_tick(&self.config.robot, self.driver.pipeline().board());
        self.wheels.counts(t_us, left, right, metres_per_tick);
    }

    fn handle(&mut self, input: Input<'_>) {
        let Self { driver, outputs, .. } = self;
        driver.handle(input, |_, update| outputs.take(update));
        self.driver.take_sweeps().iter().for_each(|sweep| self.drill.sweep(sweep));
    }

    fn advance(&mut self, at: Timestamp) -> Timestamp {
        let Self { driver, outputs, .. } = self;
        driver.advance(at, |_, update| outputs.take(update))
    }

    fn take_link_changes(&mut self) {
        while let Some(change) = self.link.poll_change() {
            self.outputs.line.link(change);
        }
    }
}

impl Outputs {
    fn take(&mut self, update: Update<'_>) {
        match update {
            Update::Transmit(frame) => self.transmit.push(frame.clone()),
            Update::Event(event) => self.state.take(event),
            Update::Truth(..) | Update::Input => {}
        }
    }
}

/// A difference between robot and configuration, which only a drive among walls shows.
fn model(event: &ModelEvent) -> Finding {
    let remedies: Vec<String> = event.finding.remedies.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    let fix = if remedies.is_empty() {
        "check the configuration's [robot] and [ring] against the robot, key by key".into()
    } else {
        format!("set {} in the robot's TOML (--config)", remedies.join(" or "))
    };
    Finding::new(Level::Warning, "model.differs", event.finding.clause.clone(), fix)
}

/// A board that fires nothing and answers nothing has not heard START.
fn deaf(finding: &mut Finding) {
    finding.text =
        "the board sends, but answers nothing that slamd sends: it does not hear, so its sensors never start".into();
    finding.fix = Some(
        "check the wire from the computer (TX) to the board (RX), and that the firmware reads its serial port".into(),
    );
}

/// The sensors that the estimator classifies as noisy. Only the map can distinguish scatter from a real room.
fn noisy(states: &[SensorState]) -> impl Iterator<Item = Finding> {
    let is_noisy = |state: &SensorState| *state == SensorState::Faulty(FaultKind::Noisy);
    states.iter().enumerate().filter(move |(_, state)| is_noisy(state)).map(|(sensor, _)| {
        let text = format!("sensor {sensor} is noisy: its readings scatter compared with the other sensors");
        let fix = format!("tighten sensor {sensor}'s plug, give it a capacitor of 100 uF at its supply, or replace it");
        Finding::new(Level::Warning, "sensor.noisy", text, fix)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{ModelAspect, ModelFinding};

    #[test]
    fn a_difference_names_the_key_that_mends_it() {
        let at = Timestamp::default();
        let differs = |remedies| {
            let clause = "the wheels report 4.0 times the travel that the walls show".into();
            let finding = ModelFinding { aspect: ModelAspect::WheelScale, measured: 4.0, sigma: 0.1, clause, remedies };
            model(&ModelEvent { at, since: at, finding, state: ModelState::Doubted })
        };
        let named = differs(vec![("robot.ticks_per_turn", "1440".into()), ("robot.wheel_radius_m", "0.03".into())]);
        assert_eq!((named.id, named.level), ("model.differs", Level::Warning));
        let fix = "set robot.ticks_per_turn = 1440 or robot.wheel_radius_m = 0.03 in the robot's TOML (--config)";
        assert_eq!(named.fix.as_deref(), Some(fix));
        assert!(differs(Vec::new()).fix.is_some_and(|fix| fix.contains("[ring]")));
    }
}
