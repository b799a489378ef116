//! The board's clock compared with the host's, and the round-trip time.

use super::finding::{Finding, Level};
use slamd_core::{
    DeviceTime, Timestamp,
    stages::{ClockMap, Widener},
};
use slamd_protocol::{FrameDecoder, Message};

/// Largest median round trip without a warning, seconds. Longer trips make the pings' times too uncertain; an FTDI bridge delays bytes by 16 ms
/// in its default setting.
const MAX_MEDIAN_S: f64 = 0.012;
/// Largest rate error, parts per million: no resonator is worse, so a larger one has another cause.
const MAX_PPM: f64 = 15_000.0;
const MIN_TRIPS: usize = 5;

/// Time requests and their responses.
#[derive(Default)]
pub(super) struct ClockEvidence {
    sent: FrameDecoder,
    pending: Option<(u16, Timestamp)>,
    widener: Widener,
    map: ClockMap,
    trips_s: Vec<f64>,
    span: Option<(DeviceTime, DeviceTime)>,
}

impl ClockEvidence {
    pub(super) fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        for &byte in bytes {
            let Some(frame) = self.sent.push(byte) else { continue };
            if let Ok(Message::TimeRequest { token }) = Message::parse(frame.kind, frame.payload) {
                self.pending = Some((token, at));
            }
        }
    }

    pub(super) fn answered(&mut self, at: Timestamp, token: u16, rx_us: u32, tx_us: u32) {
        let Some((_, sent)) = self.pending.take_if(|(pending, _)| *pending == token) else { return };
        let (Some(received), Some(answered)) = (self.widener.widen(rx_us), self.widener.widen(tx_us)) else { return };
        let trip_s = at.seconds_since(sent) - answered.seconds_since(received);
        if !(0.0..1.0).contains(&trip_s) {
            return;
        }
        self.trips_s.push(trip_s);
        let (first, _) = *self.span.get_or_insert((received, received));
        self.span = Some((first, received));
        self.map.round_trip(sent, received, answered, at);
    }

    /// The board has answered: it hears what slamd sends.
    pub(super) const fn has_answers(&self) -> bool {
        !self.trips_s.is_empty()
    }

    /// The board's clock restarted.
    pub(super) fn restart(&mut self) {
        self.widener.reset();
        self.map.reset();
        (self.span, self.pending) = (None, None);
    }

    pub(super) fn findings(&self) -> Vec<Finding> {
        if self.trips_s.len() < MIN_TRIPS {
            let text = format!("only {} responses to time requests", self.trips_s.len());
            return vec![Finding::new(Level::Note, "clock.answers", text, "run longer: --seconds 30")];
        }
        let mut trips_s = self.trips_s.clone();
        trips_s.sort_by(f64::total_cmp);
        let quantile_s = |percent: usize| trips_s.get((trips_s.len() - 1) * percent / 100).copied().unwrap_or(0.0);
        let (least_s, median_s, most_s) = (quantile_s(0), quantile_s(50), quantile_s(100));
        let text =
            format!("round trip {:.1} ms (median), {:.1} to {:.1} ms", median_s * 1e3, least_s * 1e3, most_s * 1e3);
        let mut findings = vec![if median_s > MAX_MEDIAN_S {
            let fix = "an FTDI bridge delays bytes: run `setserial PORT low_latency`, or set latency_timer to 1 with a udev rule; otherwise plug the board in without a hub";
            Finding::new(Level::Warning, "clock.latency", text, fix)
        } else {
            Finding::ok("clock.latency", text)
        }];
        findings.extend(self.drift(least_s));
        findings
    }

    fn drift(&self, least_s: f64) -> Option<Finding> {
        let (first, last) = self.span?;
        let span_s = last.seconds_since(first);
        if span_s < 2.0 {
            return None;
        }
        let host_s = self.map.host_time(last)?.seconds_since(self.map.host_time(first)?);
        let ppm = (span_s / host_s - 1.0) * 1e6;
        let doubt_ppm = least_s / span_s * 1e6;
        let text = format!("the board's clock is {ppm:+.0} ppm off (+-{doubt_ppm:.0})");
        Some(if ppm.abs() > MAX_PPM + doubt_ppm {
            let fix = "set the firmware's F_CPU to the crystal on the board";
            Finding::new(Level::Warning, "clock.drift", text, fix)
        } else {
            Finding::ok("clock.drift", text)
        })
    }
}
