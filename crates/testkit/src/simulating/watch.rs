//! What must hold at each step, seen from outside the pipeline.

use slamd_core::{Context, Estimate, Event, Timestamp, Update, link::Link};
use std::cell::RefCell;
use std::rc::Rc;

/// A client that sees all that a session shows.
#[derive(Debug, Default)]
pub struct Watch {
    /// Everything that happened, in its order.
    pub events: Vec<Event>,
    pub estimate: Option<Estimate>,
    /// When the first pose was seen: the sweeps before it are used up a few at a time.
    pub first_seen: Option<Timestamp>,
    pub restarts: u64,
    now: Timestamp,
    changed: Timestamp,
}

impl Watch {
    /// A watch, and the watcher for the session that it sees.
    pub fn new() -> (Rc<RefCell<Self>>, slamd_core::Watcher) {
        let watch = Rc::new(RefCell::new(Self::default()));
        let seen = Rc::clone(&watch);
        (watch, Box::new(move |scene, sight| seen.borrow_mut().see(scene, sight)))
    }

    fn see(&mut self, scene: &Context<'_>, sight: Update<'_>) {
        assert!(scene.now >= self.now, "session time ran back from {:?} to {:?}", self.now, scene.now);
        self.now = scene.now;
        let Update::Event(event) = sight else { return };
        match event {
            Event::Estimate(estimate) => self.pose(estimate),
            Event::BoardReset { at } => {
                self.restarts += 1;
                assert_eq!(*at, scene.now);
            }
            Event::Fault(fault) => assert!(fault.at <= scene.now, "{fault:?} at {:?}", scene.now),
            Event::Localization(event) => {
                assert!(event.since <= event.at && event.at <= scene.now, "{event:?} at {:?}", scene.now);
            }
            _ => {}
        }
        self.events.push(event.clone());
    }

    fn pose(&mut self, estimate: &Estimate) {
        if let Some(before) = &self.estimate {
            assert!(before.at < estimate.at, "a pose's time ran back from {:?} to {:?}", before.at, estimate.at);
            assert!(before.sweep < estimate.sweep, "sweep {} after {}", estimate.sweep, before.sweep);
        }
        assert!(estimate.at <= self.now, "a pose of {:?} at {:?}", estimate.at, self.now);
        let pose = estimate.pose;
        let is_finite = [pose.x_m, pose.y_m, pose.theta_rad].iter().all(|x| x.is_finite());
        let is_certain = estimate.covariance.diagonal().iter().all(|variance| variance.is_finite() && *variance >= 0.0);
        assert!(is_finite && is_certain, "{estimate:?}");
        self.first_seen.get_or_insert(self.now);
        self.estimate = Some(*estimate);
    }

    /// What the link says of itself since the last call.
    pub fn link(&mut self, link: &mut Link) {
        while let Some(change) = link.poll_change() {
            assert!(change.at >= self.changed, "the link's time ran back from {:?}: {change:?}", self.changed);
            assert!(!change.cause.to_string().is_empty(), "{change:?}: without a cause");
            self.changed = change.at;
        }
    }
}
