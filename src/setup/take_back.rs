//! A setup that writes no file leaves the board with the settings that it had.

use super::robot;
use super::{Phase, SETTINGS_S, Setup};
use slamd_core::Timestamp;
use slamd_protocol::Setting;

impl Setup {
    /// Begins to give the board its settings of before; false if it still has them. It goes on with times that begin at zero, until there is
    /// progress again.
    pub fn take_back(&mut self) -> bool {
        self.wiring_ever = self.wiring_ever.or(self.wiring.unwrap_or_default());
        let is_changed = self.wiring.is_some_and(|wiring| wiring != self.wiring_before);
        if is_changed {
            let progress = self.progress().clone();
            self.wiring = Some(self.wiring_before);
            self.config.board = robot::settings(self.wiring_before, self.wiring_ever);
            self.examine_anew(Timestamp::default());
            self.phase = Phase::TakeBack(progress);
        }
        is_changed
    }

    /// The settings that the board has not taken back.
    #[must_use]
    pub fn not_taken_back(&self) -> Vec<&'static str> {
        self.missing_settings().map(Setting::name).collect()
    }

    pub(super) fn await_settings(&mut self, at: Timestamp) {
        let is_over = self.not_taken_back().is_empty() || at.seconds() > SETTINGS_S;
        if let (true, Phase::TakeBack(progress)) = (is_over, &mut self.phase) {
            self.phase = Phase::Over(std::mem::replace(progress, super::Progress::Busy));
        }
    }
}
