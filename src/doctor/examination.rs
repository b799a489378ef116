//! Evidence from what is read and written.

use super::clock::ClockEvidence;
use super::finding::{Finding, Level, Report};
use super::line::LineEvidence;
use super::sensors::SensorEvidence;
use super::wheels::WheelEvidence;
use bytes::Bytes;
use slamd_core::config::Config;
use slamd_core::event::{Event, FaultKind, Input, Output, SensorState};
use slamd_core::link::{Link, Reception, Remedy};
use slamd_core::pipeline::Pipeline;
use slamd_core::time::Timestamp;
use slamd_protocol::{DELIMITER, FrameDecoder, Message, Setting};

/// A board under examination: fed as a session is, asked for its findings at the end.
pub struct Examination {
    config: Config,
    pipeline: Pipeline,
    link: Link,
    decoder: FrameDecoder,
    line: LineEvidence,
    sensors: SensorEvidence,
    wheels: WheelEvidence,
    clock: ClockEvidence,
    told: [Option<i32>; Setting::ALL.len()],
    transmit: Vec<Bytes>,
    restarts: u64,
    now: Timestamp,
}

impl Examination {
    /// An examination of a board whose port has just been opened at `baud`.
    #[must_use]
    pub fn new(config: &Config, baud: u32, port: &str) -> Self {
        let pipeline = slamd_paper::pipeline(config, slamd_core::pipeline::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused");
        let mut link = Link::new(baud);
        link.opened(Timestamp::default(), port, &reception(&pipeline));
        Self {
            config: config.clone(),
            pipeline,
            link,
            decoder: FrameDecoder::new(),
            line: LineEvidence::new(baud),
            sensors: SensorEvidence::default(),
            wheels: WheelEvidence::default(),
            clock: ClockEvidence::default(),
            told: [None; Setting::ALL.len()],
            transmit: Vec::new(),
            restarts: 0,
            now: Timestamp::default(),
        }
    }

    /// Bytes were read; none where the port has been opened again, as a capture says it.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        self.run_until(at);
        if bytes.is_empty() {
            self.decoder.push(DELIMITER);
            self.wheels.restart();
            return self.handle(Input::Opened { at: self.now });
        }
        self.handle(Input::Received { at: self.now, bytes });
        self.line.received(self.now, bytes.len());
        self.link.heard(self.now, bytes, &reception(&self.pipeline));
        self.hear_link();
        let counters = self.pipeline.counters();
        if counters.restarts > self.restarts {
            self.restarts = counters.restarts;
            self.wheels.restart();
            self.clock.restart();
            self.sensors.restart();
            self.line.restart();
        }
        for &byte in bytes {
            let Some(frame) = self.decoder.push(byte) else { continue };
            if let Ok(message) = Message::parse(frame.kind, frame.payload) {
                self.message(&message);
            }
        }
    }

    /// Bytes were written.
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        self.run_until(at);
        self.handle(Input::Sent { at: self.now, bytes });
        self.clock.sent(self.now, bytes);
    }

    /// Handles the deadlines up to `at`.
    pub fn run_until(&mut self, at: Timestamp) {
        let at = at.max(self.now);
        loop {
            let of_link = self.link.deadline();
            let deadline = of_link.into_iter().fold(self.pipeline.next_deadline(), Ord::min).max(self.now);
            if deadline > at {
                self.now = at;
                return;
            }
            self.now = deadline;
            self.handle(Input::Tick { at: deadline });
            self.link.tick(deadline, &reception(&self.pipeline));
            self.hear_link();
        }
    }

    /// When [`Examination::run_until`] is next due.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.link.deadline().into_iter().fold(self.pipeline.next_deadline(), Ord::min)
    }

    /// Frames to be written to the board since the last call.
    pub fn take_transmit(&mut self) -> Vec<Bytes> {
        std::mem::take(&mut self.transmit)
    }

    /// Another rate at which the port should be listened to.
    pub fn take_baud(&mut self) -> Option<u32> {
        match self.link.take_remedy()? {
            Remedy::Baud(baud) => Some(baud),
            Remedy::Reopen => None,
        }
    }

    /// True where a good frame has been received.
    #[must_use]
    pub fn has_frames(&self) -> bool {
        self.pipeline.counters().frames > 0
    }

    /// The board's own value of a setting, where it has told it.
    fn told(&self, setting: Setting) -> Option<i32> {
        self.told.get(usize::from(setting.key()).checked_sub(1)?).copied().flatten()
    }

    /// What was found, and what each sensor gave.
    #[must_use]
    pub fn findings(&self) -> (Vec<Finding>, Vec<super::SensorStatistics>) {
        let counters = self.pipeline.counters();
        let mut findings = self.line.findings(&counters, self.pipeline.board(), self.link.baud());
        let answers = counters.frames > counters.echoed && !self.pipeline.board().is_refused();
        if !answers {
            return (findings, Vec::new());
        }
        let sensors = match (self.pipeline.board().hello(), self.pipeline.ring()) {
            (_, Some(ring)) => ring.len(),
            (Some(hello), None) => usize::from(hello.sensors),
            (None, None) => 0,
        };
        let statistics = self.sensors.statistics(sensors, self.pipeline.ring());
        let path_m = self.wheels.path_m(&self.config.robot, self.pipeline.board());
        findings.extend(self.sensors.findings(
            &statistics,
            path_m,
            self.config.ring.max_range_m,
            self.told(Setting::SlotUs),
        ));
        findings.extend(noisy(self.pipeline.states()));
        findings.extend(self.wheels.findings(&self.config.robot, self.pipeline.board(), |setting| {
            self.told(setting).or_else(|| {
                self.config.settings().find(|(configured, _)| *configured == setting).map(|(_, value)| value)
            }) == Some(1)
        }));
        findings.extend(self.clock.findings());
        (findings, statistics)
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
                self.sensors.sonar(sonar);
                self.wheels.counts(sonar.t_us, sonar.left_ticks, sonar.right_ticks);
            }
            Message::Encoder(encoder) => self.wheels.counts(encoder.t_us, encoder.left_ticks, encoder.right_ticks),
            Message::Status(status) => {
                self.line.status(status);
                self.sensors.status(status);
            }
            Message::TimeResponse { token, rx_us, tx_us } => self.clock.answered(self.now, *token, *rx_us, *tx_us),
            Message::ConfigValue { key, value } => {
                let place = usize::from(*key).checked_sub(1).and_then(|place| self.told.get_mut(place));
                if let Some(place) = place {
                    *place = Some(*value);
                }
            }
            _ => {}
        }
    }

    fn handle(&mut self, input: Input<'_>) {
        self.pipeline.handle(input);
        while let Some(output) = self.pipeline.poll_output() {
            match output {
                Output::Transmit(frame) => self.transmit.push(frame),
                Output::Event(Event::BoardTrouble { text, .. }) => self.line.trouble(text),
                Output::Event(_) => {}
            }
        }
    }

    fn hear_link(&mut self) {
        while let Some(change) = self.link.poll_change() {
            self.line.link(change);
        }
    }
}

/// The sensors whose readings the estimator does not believe: only the map tells scatter from a room.
fn noisy(states: &[SensorState]) -> impl Iterator<Item = Finding> {
    let is_noisy = |state: &SensorState| *state == SensorState::Faulty(FaultKind::Noisy);
    states.iter().enumerate().filter(move |(_, state)| is_noisy(state)).map(|(sensor, _)| {
        let text = format!("sensor {sensor} is noisy: its readings scatter against what the others see");
        let fix = format!("tighten sensor {sensor}'s plug, give it a capacitor of 10 uF at its supply, or replace it");
        Finding::new(Level::Warning, "sensor.noisy", text, fix)
    })
}

fn reception(pipeline: &Pipeline) -> Reception<'_> {
    let counters = pipeline.counters();
    Reception {
        frames: counters.frames,
        groups: counters.groups,
        restarts: counters.restarts,
        echoed: counters.echoed,
        board: pipeline.board(),
    }
}
