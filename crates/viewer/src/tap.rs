//! Runs on the pipeline's thread: queues small copies for the sinks and never blocks.

use super::mailbox::{Mailbox, NewMap, SinkUpdate};
use super::snapshot::Snapshot;
use slamd_core::{Context, Estimate, Event, MapChange, Pipeline, Ring, Timestamp, Update};
use std::sync::Arc;
use std::time::Duration;

/// Passes a session's updates to the sinks.
pub struct Tap {
    mailboxes: Vec<Mailbox>,
    ring: Arc<Ring>,
    /// An estimate that was not sent yet.
    estimate: Option<Estimate>,
    /// The last sweep sent.
    sweep: Option<u64>,
    is_lost: bool,
    map_revision: u64,
    map_at: Option<Timestamp>,
    walls_at: Option<Timestamp>,
    truth_at: Option<Timestamp>,
}

/// Period of sending the map, session time, seconds. The walls follow half a period later.
const MAP_PERIOD_S: f64 = 1.0;
/// Minimum time between two true poses, seconds.
const TRUTH_PERIOD_S: f64 = 0.1;

impl Tap {
    /// A tap that sends to these mailboxes.
    #[must_use]
    pub(super) fn new(mailboxes: Vec<Mailbox>) -> Self {
        Self {
            mailboxes,
            ring: Arc::default(),
            estimate: None,
            sweep: None,
            is_lost: false,
            map_revision: 0,
            map_at: None,
            walls_at: None,
            truth_at: None,
        }
    }

    /// Handles an update.
    pub fn see(&mut self, context: &Context<'_>, update: Update<'_>) {
        match update {
            Update::Event(Event::Estimate(estimate)) => {
                // The first poses come all at once, after the initialization. The pipeline still
                // holds only the last one's sweep.
                if let Some(earlier) = self.estimate.replace(*estimate) {
                    self.show(context, earlier.at, earlier.sweep, Some(earlier));
                }
            }
            Update::Event(Event::Localization(event)) => self.is_lost = event.is_lost(),
            Update::Event(_) | Update::Transmit(_) => {}
            Update::Truth(at, pose) => {
                if self.truth_at.is_none_or(|last| at.seconds_since(last) >= TRUTH_PERIOD_S) {
                    self.truth_at = Some(at);
                    self.offer(&SinkUpdate::Truth(at, pose));
                }
            }
            Update::Input => self.sweep(context),
        }
    }

    /// Sends the pipeline's sweep, if it is new.
    fn sweep(&mut self, context: &Context<'_>) {
        let Some(sweep) = context.pipeline.sweep() else { return };
        let estimate = self.estimate.take();
        if self.sweep == Some(sweep.index) && estimate.is_none() {
            return;
        }
        if let Some(earlier) = estimate.filter(|estimate| estimate.sweep != sweep.index) {
            self.show(context, earlier.at, earlier.sweep, Some(earlier));
        }
        if self.sweep.replace(sweep.index) != Some(sweep.index) {
            self.send_map(context.pipeline, sweep.at);
            self.show(context, sweep.at, sweep.index, estimate.filter(|estimate| estimate.sweep == sweep.index));
        }
    }

    fn show(&mut self, context: &Context<'_>, at: Timestamp, sweep: u64, estimate: Option<Estimate>) {
        if let Some(ring) = context.pipeline.ring().filter(|ring| **ring != *self.ring) {
            self.ring = Arc::new(ring.clone());
        }
        let is_newest = self.sweep == Some(sweep);
        let is_time = self.walls_at.is_none_or(|last| at.seconds_since(last) >= MAP_PERIOD_S);
        let segments = (is_newest && is_time).then(|| context.pipeline.segments().into());
        if segments.is_some() {
            self.walls_at = Some(at);
        }
        let snapshot = Snapshot {
            at,
            sweep,
            estimate,
            beams: if is_newest { Snapshot::beams(context.pipeline) } else { Vec::new() },
            ring: Arc::clone(&self.ring),
            is_lost: self.is_lost,
            segments,
            counters: context.pipeline.counters(),
            latency: Duration::from_secs_f64(context.now.seconds_since(at).max(0.0)),
            took: context.took,
        };
        self.offer(&SinkUpdate::Snapshot(Arc::new(snapshot)));
    }

    fn send_map(&mut self, pipeline: &Pipeline, at: Timestamp) {
        if self.map_at.is_some_and(|last| at.seconds_since(last) < MAP_PERIOD_S) {
            return;
        }
        let is_first = self.map_at.replace(at).is_none();
        if is_first {
            self.walls_at = Some(Timestamp::from_us(at.us().saturating_sub(500_000)));
        }
        let Some((change, next)) = pipeline.map_since(self.map_revision) else { return };
        self.map_revision = next;
        match change {
            MapChange::Patches(cell_m, patches) => {
                let patches: Vec<_> = patches.into_iter().map(Arc::new).collect();
                self.update_map(|map| {
                    map.cell_m = cell_m;
                    map.patches.extend(patches.iter().map(|patch| ((patch.column, patch.row), Arc::clone(patch))));
                });
            }
            MapChange::Whole(raster) => {
                let raster = Arc::new(raster);
                self.update_map(|map| map.whole = Some(Arc::clone(&raster)));
            }
        }
    }

    fn update_map(&self, update: impl Fn(&mut NewMap)) {
        self.mailboxes.iter().for_each(|mailbox| mailbox.update_map(&update));
    }

    fn offer(&self, update: &SinkUpdate) {
        self.mailboxes.iter().for_each(|mailbox| mailbox.offer(update.clone()));
    }
}
