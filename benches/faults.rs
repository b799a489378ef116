//! Fault detection over worlds, beams and seeds:
//! `cargo bench --bench faults -- [--seeds 101-120] [--seconds 120] [healthy] [kinds] [mixes] [split]`
//!
//! Prints Markdown tables of precision and recall in sensor-seconds (a verdict must name the true kind), latencies, and false
//! alarms per sensor and hour. A latency runs from the fault's beginning, or from the first sweep where that is later, to the
//! input that brought the verdict; a fault that is never found counts with the time that was left. `split` gives each world and
//! beam its own row. Tune on seeds 1-20, report on 101-120.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sensors, seeds and ranks are small numbers"
)]

use slamd::capture::Record;
use slamd::config::Config;
use slamd::event::{Event, FaultEvent, FaultKind as Kind, Input, Output};
use slamd::metrics::{AccuracyMeter, FaultMeter, Tally, TrueFault};
use slamd::pipeline::Pipeline;
use slamd::sim::fault::{FaultKind, FaultMix, SensorFault};
use slamd::sim::link::LinkFaults;
use slamd::sim::simulation::{SimConfig, Simulation, session};
use slamd::sim::sonar::BeamShape;
use slamd::sim::world::World;
use slamd::time::Timestamp;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What breaks.
#[derive(Clone, Copy, Debug)]
enum Scenario {
    Nothing,
    One(FaultKind),
    Paper,
    AnyEight,
    OneSide(FaultKind),
}

#[derive(Clone, Copy, Debug)]
struct Case {
    world: &'static str,
    beam: BeamShape,
    sensors: u8,
    odometry_errors: f64,
    scenario: Scenario,
    is_late: bool,
}

/// What came out of a run, or of many.
#[derive(Clone, Default)]
struct Score {
    runs: usize,
    kinds: [Tally; 4],
    whole: Tally,
    latencies_s: Vec<f64>,
    hidden: usize,
    false_alarms: u32,
    sensor_s: f64,
    ate_m: Vec<f64>,
    detail: String,
}

const KINDS: [(FaultKind, Kind); 4] = [
    (FaultKind::Saturated, Kind::Saturated),
    (FaultKind::Missing, Kind::Missing),
    (FaultKind::Noisy, Kind::Noisy),
    (FaultKind::Stuck, Kind::Stuck),
];

impl Case {
    fn schedule(&self, seed: u64, duration_s: f64) -> Vec<SensorFault> {
        let from_s = if self.is_late { 0.4 * duration_s + 0.037 * seed as f64 } else { 0.0 };
        let fault = |sensor, kind| SensorFault { sensor, kind, from_s, until_s: f64::INFINITY };
        // Any order of the sensors will do: multiples of an odd number modulo a power of two hit each sensor once.
        let shuffled = |index: u64| ((seed * 7 + index * 5) % u64::from(self.sensors)) as u8;
        match self.scenario {
            Scenario::Nothing => Vec::new(),
            Scenario::One(kind) => vec![fault(shuffled(0), kind)],
            Scenario::Paper => {
                let mut mix = FaultMix::Paper.faults(
                    self.sensors,
                    &mut slamd::sim::random::Random::new(seed, slamd::sim::random::Stream::Fault),
                );
                mix.iter_mut().for_each(|fault| fault.from_s = from_s);
                mix
            }
            Scenario::AnyEight => (0..8).map(|i| fault(shuffled(i), KINDS[(seed + i) as usize % 4].0)).collect(),
            Scenario::OneSide(kind) => (1..self.sensors / 2).map(|sensor| fault(sensor, kind)).collect(),
        }
    }

    fn run(&self, seed: u64, duration_s: f64) -> Score {
        let simulation = Simulation::new(SimConfig {
            world: World::named(self.world).expect("a built-in world"),
            seed,
            duration_s,
            mix: FaultMix::None,
            faults: self.schedule(seed, duration_s),
            beam: self.beam,
            sensors: self.sensors,
            odometry_errors: self.odometry_errors,
            clock_drift_ppm: 300.0,
            link: LinkFaults::default(),
        });
        let truth =
            simulation.faults().iter().map(|fault| fault.to_string().parse::<TrueFault>().expect("its own form"));
        let mut meter = FaultMeter::new(truth.collect());
        let mut accuracy = AccuracyMeter::default();
        let mut pipeline = Pipeline::new(&Config::default());
        let (mut first, mut now, mut detail) = (None, Timestamp::default(), String::new());
        for record in session(simulation) {
            match &record {
                Record::Received { at, bytes } => pipeline.handle(Input::Received { at: *at, bytes }),
                Record::Sent { at, bytes } => pipeline.handle(Input::Sent { at: *at, bytes }),
                Record::Truth { at, pose } => accuracy.truth(*at, *pose),
            }
            now = match record {
                Record::Received { at, .. } | Record::Sent { at, .. } | Record::Truth { at, .. } => at,
            };
            if pipeline.counters().sweeps > 0 {
                first.get_or_insert(now);
                meter.estimate(now);
            }
            while let Some(output) = pipeline.poll_output() {
                match output {
                    Output::Event(Event::Estimate(estimate)) => accuracy.estimate(estimate.at, estimate.pose),
                    Output::Event(Event::Fault(event)) => {
                        detail += &format!("  seed {seed} {:?} {:.1} s: {}\n", self, now.seconds(), event.reason);
                        meter.fault(&FaultEvent { at: now, ..event });
                    }
                    _ => {}
                }
            }
        }
        meter.estimate(now);
        let begin = first.unwrap_or_default();
        let late =
            |(fault, found): (&TrueFault, Option<Timestamp>)| found.unwrap_or(now).seconds_since(fault.from.max(begin));
        Score {
            runs: 1,
            kinds: KINDS.map(|(_, kind)| meter.tally(kind)),
            whole: meter.whole(),
            latencies_s: meter.found().map(late).collect(),
            hidden: meter.found().filter(|(_, found)| found.is_none()).count(),
            false_alarms: meter.false_alarms(),
            sensor_s: now.seconds_since(begin) * f64::from(self.sensors),
            ate_m: accuracy.accuracy().map(|accuracy| accuracy.ate_m).into_iter().collect(),
            detail,
        }
    }
}

impl Score {
    fn add(&mut self, other: &Self) {
        self.runs += other.runs;
        for (kind, more) in self.kinds.iter_mut().zip(other.kinds) {
            *kind += more;
        }
        self.whole += other.whole;
        self.latencies_s.extend(&other.latencies_s);
        self.hidden += other.hidden;
        self.false_alarms += other.false_alarms;
        self.sensor_s += other.sensor_s;
        self.ate_m.extend(&other.ate_m);
        self.detail += &other.detail;
    }
}

/// The value at a share of the sorted values.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let place = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(place).copied().unwrap_or(f64::NAN)
}

/// Runs every case with every seed on all cores and adds up by case.
fn run_all(cases: &[Case], seeds: &[u64], duration_s: f64) -> Vec<Score> {
    let next = AtomicUsize::new(0);
    let scores = Mutex::new(vec![Score::default(); cases.len()]);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let (Some(case), Some(seed)) = (cases.get(index / seeds.len()), seeds.get(index % seeds.len()))
                    else {
                        return;
                    };
                    let score = case.run(*seed, duration_s);
                    scores.lock().expect("no run panics")[index / seeds.len()].add(&score);
                }
            });
        }
    });
    scores.into_inner().expect("no run panics")
}

/// One table: a row per label, the cases under one label pooled.
fn table(title: &str, cases: &[(String, Case)], seeds: &[u64], duration_s: f64) {
    println!("\n{title}\n");
    println!(
        "| case | runs | precision / recall, kind named | any kind | latency s p50 / p90 | never found | false alarms per sensor and hour | ATE m p50 / p90 |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let scores = run_all(&cases.iter().map(|(_, case)| *case).collect::<Vec<_>>(), seeds, duration_s);
    let mut labels: Vec<&String> = cases.iter().map(|(label, _)| label).collect();
    labels.dedup();
    let percent = |share: Option<f64>| share.map_or_else(|| "-".into(), |share| format!("{share:.3}"));
    for label in labels {
        let mut score = Score::default();
        cases.iter().zip(&scores).filter(|((of, _), _)| of == label).for_each(|(_, part)| score.add(part));
        let mut named = Tally::default();
        score.kinds.iter().for_each(|kind| named += *kind);
        println!(
            "| {label} | {} | {} / {} | {} / {} | {:.2} / {:.2} | {} of {} | {:.2} | {:.3} / {:.3} |",
            score.runs,
            percent(named.precision()),
            percent(named.recall()),
            percent(score.whole.precision()),
            percent(score.whole.recall()),
            quantile(&score.latencies_s, 0.5),
            quantile(&score.latencies_s, 0.9),
            score.hidden,
            score.latencies_s.len(),
            f64::from(score.false_alarms) / (score.sensor_s / 3600.0),
            quantile(&score.ate_m, 0.5),
            quantile(&score.ate_m, 0.9),
        );
        if std::env::var_os("VERBOSE").is_some() {
            eprint!("{}", score.detail);
        }
    }
}

/// A case in each world with each beam; `label` names the row.
fn everywhere(label: &str, case: Case, is_split: bool) -> Vec<(String, Case)> {
    let mut cases = Vec::new();
    for world in ["flat", "office", "furnished"] {
        for beam in [BeamShape::Cone, BeamShape::Point] {
            let label = if is_split { format!("{label}, {world}, {beam:?}") } else { label.into() };
            cases.push((label, Case { world, beam, ..case }));
        }
    }
    cases
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let option = |name: &str, default: &'static str| {
        let place = arguments.iter().position(|argument| argument == name);
        place.and_then(|place| arguments.get(place + 1)).cloned().unwrap_or_else(|| default.into())
    };
    let seeds = option("--seeds", "101-120");
    let (first, last) = seeds.split_once('-').expect("--seeds FIRST-LAST");
    let seeds: Vec<u64> = (first.parse().expect("a seed")..=last.parse().expect("a seed")).collect();
    let duration_s: f64 = option("--seconds", "120").parse().expect("seconds");
    let is_said = |word: &str| arguments.iter().any(|argument| argument == word);
    let is_all = !["healthy", "kinds", "mixes"].into_iter().any(is_said);
    let is_split = is_said("split");
    let usual = Case {
        world: "flat",
        beam: BeamShape::Cone,
        sensors: 32,
        odometry_errors: 1.0,
        scenario: Scenario::Nothing,
        is_late: false,
    };
    if is_all || is_said("healthy") {
        let mut cases = Vec::new();
        for sensors in [32, 16, 8] {
            cases.extend(everywhere(&format!("{sensors} healthy sensors"), Case { sensors, ..usual }, is_split));
        }
        let wild = Case { odometry_errors: 3.0, ..usual };
        cases.extend(everywhere("32 healthy sensors, odometry errors x 3", wild, is_split));
        table("## No faulty sensor", &cases, &seeds, duration_s);
    }
    if is_all || is_said("kinds") {
        let mut cases = Vec::new();
        for (kind, _) in KINDS {
            for (sensors, is_late) in [(32, false), (32, true), (16, true), (8, true)] {
                let when = if is_late { "in mid-run" } else { "from the start" };
                let label = format!("{} {when}, 1 of {sensors}", kind.word());
                cases.extend(everywhere(
                    &label,
                    Case { sensors, is_late, scenario: Scenario::One(kind), ..usual },
                    is_split,
                ));
            }
        }
        table("## One faulty sensor", &cases, &seeds, duration_s);
    }
    if is_all || is_said("mixes") {
        let mut cases = Vec::new();
        for (name, scenario) in [
            ("the paper's mix", Scenario::Paper),
            ("any 8 of 32", Scenario::AnyEight),
            ("left side saturated", Scenario::OneSide(FaultKind::Saturated)),
            ("left side missing", Scenario::OneSide(FaultKind::Missing)),
            ("left side noisy", Scenario::OneSide(FaultKind::Noisy)),
        ] {
            for (is_late, when) in [(false, "from the start"), (true, "in mid-run")] {
                cases.extend(everywhere(&format!("{name} {when}"), Case { scenario, is_late, ..usual }, is_split));
            }
        }
        table("## Many faulty sensors", &cases, &seeds, duration_s);
    }
}
