//! The serial link: received data, damage, baud rate and firmware.

use super::finding::{Finding, Level};
use super::troubles::Troubles;
use slamd_core::{
    Board, Counters, Timestamp, Topic,
    link::{LinkCause, LinkChange, LinkState},
};
use slamd_protocol::Status;

/// A start bit, eight of data, a stop bit.
const BITS_PER_BYTE: f64 = 10.0;
/// Least number of damaged or lost frames for a finding: opening the port always cuts one frame.
const MIN_COUNT: u64 = 3;
/// Shares of damaged or lost frames for a warning, and for a problem, which ruins the map.
const WARNING_SHARE: f64 = 0.001;
const PROBLEM_SHARE: f64 = 0.05;
/// Least supply voltage, millivolts: USB gives 5 V, and below this the sensors' range decreases.
const MIN_SUPPLY_MV: u16 = 4_600;
/// Largest used share of the baud rate: above it, frames begin to be dropped.
const FULL: f64 = 0.9;

/// Evidence about the link.
pub(super) struct LineEvidence {
    wanted_baud: u32,
    bytes: u64,
    first_at: Option<Timestamp>,
    last_at: Timestamp,
    causes: Vec<LinkCause>,
    last_status: Option<Status>,
    overruns: u64,
    board_crc_errors: u64,
    least_supply_mv: Option<u16>,
}

impl LineEvidence {
    pub(super) fn new(wanted_baud: u32) -> Self {
        Self {
            wanted_baud,
            bytes: 0,
            first_at: None,
            last_at: Timestamp::default(),
            causes: Vec::new(),
            last_status: None,
            overruns: 0,
            board_crc_errors: 0,
            least_supply_mv: None,
        }
    }

    pub(super) fn received(&mut self, at: Timestamp, bytes: usize) {
        self.first_at.get_or_insert(at);
        self.last_at = at;
        self.bytes += bytes as u64;
    }

    pub(super) fn link(&mut self, change: LinkChange) {
        if change.state == LinkState::Listening {
            self.causes.push(change.cause);
        }
    }

    /// The board's counters restarted.
    pub(super) fn restart(&mut self) {
        self.last_status = None;
    }

    pub(super) fn status(&mut self, status: &Status) {
        if let Some(last) = self.last_status.replace(*status) {
            self.overruns += u64::from(status.overruns.wrapping_sub(last.overruns));
            self.board_crc_errors += u64::from(status.crc_errors.wrapping_sub(last.crc_errors));
        }
        if let Some(supply) = status.supply_mv {
            let least = self.least_supply_mv.unwrap_or(u16::MAX);
            self.least_supply_mv = Some(supply.get().min(least));
        }
    }

    pub(super) fn findings(
        &self,
        counters: &Counters,
        board: &Board,
        baud: u32,
        troubles: &Troubles<'_>,
    ) -> Vec<Finding> {
        if counters.frames == 0 {
            return vec![self.nothing_valid()];
        }
        let mut findings = Vec::new();
        if counters.echoed > 0 {
            findings.push(Finding::new(
                Level::Problem,
                "line.echo",
                format!("the line echoes what slamd sends: {} of its own messages came back", counters.echoed),
                "separate the board's receive and transmit wires (RX0, TX0) and switch off any local echo of the adapter",
            ));
            if counters.echoed == counters.frames {
                return findings;
            }
        }
        if let Some(refusal) = board.refusal() {
            let (text, fix) = refusal.rsplit_once(": ").unwrap_or((&refusal, "update the firmware or slamd"));
            findings.push(Finding::new(Level::Problem, "line.protocol", text, fix));
            return findings;
        }
        match board.hello() {
            Some(_) => findings.push(Finding::ok("line.board", board.description())),
            None => findings.push(match troubles.identity() {
                Some((text, fix)) => Finding::new(Level::Problem, "line.board", text, fix),
                None => Finding::new(
                    Level::Warning,
                    "line.board",
                    "the board has not identified itself",
                    "press its reset button while this runs; if that does not help, flash protocol/firmware again",
                ),
            }),
        }
        if baud != self.wanted_baud {
            findings.push(Finding::new(
                Level::Warning,
                "line.baud",
                format!("the board sends at {baud} baud, not at {}", self.wanted_baud),
                format!("start slamd with --baud {baud}"),
            ));
        }
        findings.extend(troubles.findings(counters));
        findings.extend(self.rate(baud));
        findings.extend(damage(counters, troubles.has(Topic::Content)));
        findings.extend(self.board_side());
        findings.extend(restarts(counters.restarts));
        findings
    }

    /// Why no frame was received.
    fn nothing_valid(&self) -> Finding {
        const RESET: &str =
            "name the board's port (`slamd ports`), flash protocol/firmware, and check its supply and its ground wire";
        let cause = self.causes.iter().rev().find(|cause| {
            matches!(cause, LinkCause::WrongFirmware { .. } | LinkCause::NoiseAtAllRates | LinkCause::SilenceAtAllRates)
        });
        let id = match cause {
            Some(LinkCause::WrongFirmware { .. }) => "line.firmware",
            _ if self.bytes > 0 => "line.noise",
            _ => "line.silence",
        };
        let otherwise = if self.bytes > 0 {
            format!("noise: {} bytes arrived but no valid frame", self.bytes)
        } else {
            "silence: nothing arrived".into()
        };
        let text = cause.map(ToString::to_string);
        match text.as_ref().and_then(|text| text.rsplit_once(": ")) {
            Some((text, fix)) => Finding::new(Level::Problem, id, text, fix),
            None => Finding::new(Level::Problem, id, otherwise, RESET),
        }
    }

    fn rate(&self, baud: u32) -> Option<Finding> {
        let seconds = self.last_at.seconds_since(self.first_at?);
        if seconds < 1.0 {
            return None;
        }
        let rate = self.bytes as f64 / seconds;
        let share = rate * BITS_PER_BYTE / f64::from(baud);
        let text = format!("{rate:.0} bytes/s, {:.0} % of the line at {baud} baud", share * 100.0);
        Some(if share > FULL {
            let fix = "set [board] encoder_period_ms or slot_us higher, or build the firmware for a higher baud rate";
            Finding::new(Level::Warning, "line.rate", format!("the line is full: {text}"), fix)
        } else {
            Finding::ok("line.rate", text)
        })
    }

    /// The board's own report on link and supply.
    fn board_side(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        if self.overruns > 0 {
            findings.push(Finding::new(
                Level::Warning,
                "line.overruns",
                format!("the board could not send {} frames because the line was busy", self.overruns),
                "set [board] encoder_period_ms or slot_us higher, or build the firmware for a higher baud rate",
            ));
        }
        if self.board_crc_errors > 0 {
            findings.push(Finding::new(
                Level::Warning,
                "line.to_board",
                format!("{} frames reached the board damaged", self.board_crc_errors),
                "shorten the cable, connect the grounds, and keep it away from the motors' wires",
            ));
        }
        if let Some(supply_mv) = self.least_supply_mv.filter(|&supply_mv| supply_mv < MIN_SUPPLY_MV) {
            findings.push(Finding::new(
                Level::Warning,
                "line.supply",
                format!("the board's supply fell to {:.2} V", f64::from(supply_mv) * 1e-3),
                "power sensors and motors from their own supply and connect the grounds",
            ));
        }
        findings
    }
}

/// Damaged and missing frames, and messages of unknown type; invalid content counts among these unless it `has_content` findings.
fn damage(counters: &Counters, has_content: bool) -> Vec<Finding> {
    let level = |count: u64| {
        let share = count as f64 / (count + counters.frames) as f64;
        let is_relevant = count >= MIN_COUNT && share > WARNING_SHARE;
        let level = if share > PROBLEM_SHARE { Level::Problem } else { Level::Warning };
        is_relevant.then_some((level, share * 100.0))
    };
    // Text between frames damages the one after it, and has its own finding.
    let all = counters.crc_errors + counters.malformed;
    let damaged = all.saturating_sub(counters.stray_texts);
    let mut findings = Vec::new();
    if let Some((level, percent)) = level(damaged) {
        let text = format!("{damaged} frames ({percent:.1} %) arrived damaged");
        let fix =
            "shorten the cable, connect the grounds, keep it away from the motors' wires, or use a lower baud rate";
        findings.push(Finding::new(level, "line.damaged", text, fix));
    }
    // A damaged frame also counts as missing in the sequence numbers.
    let lost = counters.lost_frames.saturating_sub(all);
    if let Some((level, percent)) = level(lost) {
        let text = format!("{lost} frames ({percent:.1} %) are missing");
        let fix = "plug the board in without a hub, set [board] encoder_period_ms higher, and look for a busy computer";
        findings.push(Finding::new(level, "line.lost", text, fix));
    }
    if findings.is_empty() {
        findings.push(Finding::ok(
            "line.frames",
            format!("{} frames, {damaged} damaged, {} missing", counters.frames, counters.lost_frames),
        ));
    }
    let unknown = counters.unknown + if has_content { 0 } else { counters.refused };
    if unknown > 0 {
        let text = format!("{unknown} messages with unknown type or invalid content");
        findings.push(Finding::new(
            Level::Warning,
            "line.unknown",
            text,
            "update slamd and the firmware to the same version",
        ));
    }
    findings
}

fn restarts(count: u64) -> Option<Finding> {
    let level = match count {
        0 => return None,
        1 => Level::Warning,
        _ => Level::Problem,
    };
    let times = if count == 1 { "once".into() } else { format!("{count} times") };
    Some(Finding::new(
        level,
        "line.restarts",
        format!("the board restarted {times}"),
        "its supply fails or its cable is loose: power sensors and motors from their own supply",
    ))
}
