//! What a watching client is told when it changes.

use super::super::report::{DeviceState, Report};
use super::Client;
use slamd_core::{FaultEvent, ModelState, SensorState, Snapshot, Timestamp};

impl Client {
    /// Sends what changed of link and sensors since the last report.
    pub(super) fn send_changes(&mut self, at: Timestamp, snapshot: &Snapshot) {
        if !self.sent.device.as_ref().is_some_and(|state| state.is_state_of(snapshot)) {
            self.sent.device = Some(DeviceState::new(snapshot));
            self.send(at, &Report::device(snapshot));
        }
        if self.sent.models != snapshot.models {
            let before = std::mem::replace(&mut self.sent.models, snapshot.models.clone());
            // Each aspect keeps its index. A new watcher gets what differs now.
            for (index, event) in snapshot.models.iter().enumerate() {
                let is_news = index < before.len() || event.state != ModelState::Resolved;
                if is_news && before.get(index) != Some(event) {
                    self.send(at, &Report::model(event));
                }
            }
        }
        if self.sent.changes != snapshot.changes {
            let before = std::mem::replace(&mut self.sent.changes, snapshot.changes.clone());
            for (sensor, change) in snapshot.changes.iter().enumerate() {
                let before = before.get(sensor).and_then(Option::as_ref);
                // A new watcher gets the faults of the present, not those that have passed.
                let is_news = |change: &&FaultEvent| before.is_some() || change.state != SensorState::Healthy;
                if let Some(change) = change.as_ref().filter(|change| Some(*change) != before).filter(is_news) {
                    self.send(at, &Report::fault(change));
                }
            }
        }
    }
}
