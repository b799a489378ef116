//! A robot that differs from its configuration is named, and the map is that of the true one.

use slamd_core::{Config, Driver, Estimate, Event, ModelAspect, ModelState, Pipeline, Pose2, Record, Start, Update};
use slamd_sim::fault::FaultMix;
use slamd_sim::link::LinkFaults;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;

/// What a drive said of its robot.
struct Told {
    /// The first finding: what, whether it is corrected, the key and the value that mend it, and the metres driven until then.
    first: Option<(ModelAspect, ModelState, &'static str, String, f64)>,
    /// Way from the first pose after the finding to the last pose, by the estimate and in truth, metres.
    legs_m: [f64; 2],
    is_uncertain: bool,
}

#[expect(clippy::unwrap_used, reason = "a named world and a fresh start always exist")]
fn drive(seed: u64, sensors: u8, misconfigure: impl Fn(&mut Config)) -> Told {
    let world = World::named("flat").unwrap();
    let simulation = Simulation::new(SimConfig {
        world,
        seed,
        duration_s: 60.0,
        mix: FaultMix::None,
        faults: Vec::new(),
        beam: BeamShape::Cone,
        sensors,
        odometry_errors: 1.0,
        clock_drift_ppm: 20.0,
        link: LinkFaults::default(),
    });
    let mut config = Config::default();
    config.robot.ticks_per_turn = Some(1440);
    misconfigure(&mut config);
    let mut driver = Driver::new(Pipeline::new(&config, Start::Fresh).unwrap());
    let (mut first, mut driven_m, mut is_uncertain) = (None, 0.0, false);
    let (mut truth, mut start): (Option<Pose2>, Option<(Estimate, Pose2)>) = (None, None);
    let mut legs_m = [0.0; 2];
    for record in session(simulation) {
        if let Record::Truth { pose, .. } = &record {
            driven_m += truth.map_or(0.0, |before| (pose.position() - before.position()).norm());
            truth = Some(*pose);
        }
        driver.feed(&record, |_, update| match update {
            Update::Event(Event::Model(event)) if first.is_none() => {
                let (key, value) = event.finding.remedies[0].clone();
                first = Some((event.finding.aspect, event.state, key, value, driven_m));
                start = None;
            }
            Update::Event(Event::Localization(event)) => is_uncertain = event.is_lost(),
            Update::Event(Event::Estimate(estimate)) => {
                let Some(truth) = truth else { return };
                let (from, true_from) = *start.get_or_insert((*estimate, truth));
                legs_m = [
                    (estimate.pose.position() - from.pose.position()).norm(),
                    (truth.position() - true_from.position()).norm(),
                ];
            }
            _ => {}
        });
    }
    Told { first, legs_m, is_uncertain }
}

#[test]
fn four_times_too_many_ticks_are_named_and_corrected() {
    let told = drive(3, 16, |config| config.robot.ticks_per_turn = Some(360));
    let (aspect, state, key, value, driven_m) = told.first.unwrap();
    assert_eq!((aspect, state, key), (ModelAspect::WheelScale, ModelState::Corrected, "robot.ticks_per_turn"));
    let ticks: f64 = value.parse().unwrap();
    assert!((1_250.0..1_650.0).contains(&ticks), "{ticks}");
    // `cargo xtask never-silent` measures the median.
    assert!(driven_m < 4.0, "{driven_m} m");
    let [estimated_m, true_m] = told.legs_m;
    assert!((estimated_m - true_m).abs() < 0.1, "{estimated_m} m for {true_m} m");
    assert!(!told.is_uncertain);
}

#[test]
fn a_turned_ring_is_named_and_corrected() {
    let told = drive(3, 8, |config| config.ring.circle = None);
    assert!(told.first.is_none(), "the robot is as configured");
    let told = drive(3, 8, |config| config.ring.rotation_deg = -90.0);
    let (aspect, state, key, value, _) = told.first.unwrap();
    assert_eq!((aspect, state, key), (ModelAspect::RingRotation, ModelState::Corrected, "ring.rotation_deg"));
    let degrees: f64 = value.parse().unwrap();
    assert!(degrees.abs() < 12.0, "{degrees}");
}

#[test]
fn a_mirrored_ring_is_named_and_the_pose_stays_uncertain() {
    let told = drive(4, 16, |config| config.ring.mirrored = true);
    let (aspect, state, ..) = told.first.unwrap();
    assert_eq!((aspect, state), (ModelAspect::TurnSign, ModelState::Doubted));
    assert!(told.is_uncertain);
}

#[test]
fn a_resumed_session_keeps_the_robot_that_was_found() {
    let simulation = || {
        Simulation::new(SimConfig {
            world: World::named("flat").unwrap(),
            seed: 3,
            duration_s: 30.0,
            mix: FaultMix::None,
            faults: Vec::new(),
            beam: BeamShape::Cone,
            sensors: 16,
            odometry_errors: 1.0,
            clock_drift_ppm: 20.0,
            link: LinkFaults::default(),
        })
    };
    let mut config = Config::default();
    config.robot.ticks_per_turn = Some(360);
    // What the start says of the robot, and the session at the end.
    let drive = |config: &Config, start: Start| {
        let mut driver = Driver::new(Pipeline::new(config, start).unwrap());
        let mut told = None;
        for record in session(simulation()) {
            driver.feed(&record, |_, update| match update {
                Update::Event(Event::Model(event)) if told.is_none() => {
                    told = Some((event.at.seconds(), event.finding.remedies[0].0, event.state));
                }
                _ => {}
            });
        }
        (told, driver.pipeline().saved_state().unwrap())
    };
    let (told, state) = drive(&config, Start::Fresh);
    assert!(told.is_some_and(|(at_s, ..)| at_s > 3.0), "{told:?}");
    let (told, again) = drive(&config, Start::Resume(state.clone().into()));
    let (at_s, key, state_told) = told.unwrap();
    assert!(at_s < 2.0, "{at_s}");
    assert_eq!((key, state_told), ("robot.ticks_per_turn", ModelState::Corrected));
    assert_eq!(again.robot, state.robot);
    // The user has mended the configuration.
    config.robot.ticks_per_turn = Some(1440);
    let (told, _) = drive(&config, Start::Resume(state.into()));
    assert_eq!(told, None);
}
