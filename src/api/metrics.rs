//! Counters and gauges in the text format of Prometheus (version 0.0.4).

use crate::log_counts::{DROPPED, SUMMED_UP};
use crate::recorder::DiskState;
use slamd_core::{Snapshot, link::LinkState};
use std::fmt::Write as _;

/// The server's own counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Served {
    /// Connected clients.
    pub(super) clients: usize,
    /// Clients refused because there were too many.
    pub(super) refused: u64,
    /// Connections closed for newcomers because they had sent neither a token nor a request.
    pub(super) sent_away: u64,
    /// Clients dropped because they were too slow.
    pub(super) slow: u64,
}

/// The metrics page.
pub(super) fn page(snapshot: &Snapshot, served: Served, disk: &DiskState) -> String {
    let mut page = String::new();
    let counted = &snapshot.counters;
    let counters = [
        ("frames", "Frames whose checksum held.", counted.frames),
        ("lost_frames", "Frames that the sequence numbers say are missing.", counted.lost_frames),
        ("crc_errors", "Frames whose checksum did not hold.", counted.crc_errors),
        ("malformed_frames", "Other frames that could not be decoded.", counted.malformed),
        ("dropped_bytes", "Bytes that belong to no good frame.", counted.dropped_bytes),
        ("unknown_frames", "Good frames of a type this version does not know.", counted.unknown),
        ("refused_frames", "Good frames whose content was refused.", counted.refused),
        ("echoed_frames", "The host's own messages, come back.", counted.echoed),
        ("groups", "Fired groups of the ring that were used.", counted.groups),
        ("board_restarts", "Restarts of the board.", counted.restarts),
        ("sweeps", "Sweeps used.", counted.sweeps),
        ("dropped_sweeps", "Sweeps given up because too much of them was missing.", counted.dropped_sweeps),
        ("unwrapped_steps", "Wheel steps across a wrap at 16 bits, which are used.", counted.unwrapped_steps),
        ("refused_steps", "Wheel steps that no wheel can roll, which are not used.", counted.refused_steps),
        ("refused_stamps", "Messages not used because the board's clock ran backwards.", counted.refused_stamps),
        ("stray_texts", "Damaged frames that hold readable text.", counted.stray_texts),
    ];
    for (name, help, value) in counters {
        family(&mut page, &format!("{name}_total"), "counter", help, [(String::new(), value as f64)]);
    }
    program(&mut page, served, disk);
    family(&mut page, "session_seconds", "gauge", "Session time.", [(String::new(), snapshot.at.seconds())]);
    family(&mut page, "api_clients", "gauge", "Clients that are connected.", [(String::new(), served.clients as f64)]);
    let state =
        |state: LinkState| (format!("{{state=\"{}\"}}", state.word()), f64::from(u8::from(state == snapshot.link)));
    let states = LinkState::ALL.map(state);
    family(&mut page, "link_state", "gauge", "1 for the state of the line to the board.", states);
    family(&mut page, "sensors", "gauge", "Sensors of the ring.", [(String::new(), snapshot.ring.len() as f64)]);
    let faulty = (0..snapshot.ring.len()).map(|sensor| {
        let is_faulty = snapshot.faulty().any(|change| change.sensor == sensor);
        (format!("{{sensor=\"{sensor}\"}}"), f64::from(u8::from(is_faulty)))
    });
    family(&mut page, "sensor_faulty", "gauge", "1 where a sensor is ignored.", faulty);
    let differences = [(String::new(), snapshot.doubted_models().count() as f64)];
    family(
        &mut page,
        "model_findings",
        "gauge",
        "Ways in which the robot differs from its configuration.",
        differences,
    );
    if let Some(estimate) = &snapshot.estimate {
        let sigma = |i: usize| libm::sqrt(estimate.covariance[(i, i)]);
        let position = libm::sqrt(estimate.covariance[(0, 0)] + estimate.covariance[(1, 1)]);
        let is_lost = f64::from(u8::from(snapshot.is_lost));
        let gauges = [
            ("position_sigma_metres", "Standard deviation of the position.", position),
            ("heading_sigma_radians", "Standard deviation of the heading.", sigma(2)),
            ("position_lost", "1 while the poses are not to be relied on.", is_lost),
        ];
        for (name, help, value) in gauges {
            family(&mut page, name, "gauge", help, [(String::new(), value)]);
        }
    }
    page
}

/// What concerns the program and not the drive: clients, disk, log.
fn program(page: &mut String, served: Served, disk: &DiskState) {
    let counters = [
        ("api_refused_clients", "Clients turned away because there were too many.", served.refused),
        ("api_sent_away", "Silent connections closed because newcomers needed their places.", served.sent_away),
        ("api_slow_clients", "Clients dropped because they were too slow.", served.slow),
        ("log_summed_up_lines", "Log lines summed up because their cause repeated.", SUMMED_UP.get()),
        ("log_dropped_lines", "Log lines dropped because nobody read them.", DROPPED.get()),
        ("recording_errors", "Failed attempts to write the recording.", disk.recording_errors),
        (
            "recording_lost_chunks",
            "Pieces of traffic that are missing from the recording.",
            disk.recording_lost + disk.recording_dropped,
        ),
        ("session_file_errors", "Failed saves of the session.", disk.session_errors),
        ("output_errors", "Failed writes of map and trajectories.", disk.output_errors),
    ];
    for (name, help, value) in counters {
        family(page, &format!("{name}_total"), "counter", help, [(String::new(), value as f64)]);
    }
    let waiting = disk.recording_waiting_bytes as f64;
    family(page, "recording_waiting_bytes", "gauge", "Bytes that wait for the disk.", [(String::new(), waiting)]);
    let failing = f64::from(u8::from(disk.is_failing()));
    family(page, "disk_failing", "gauge", "1 while something cannot be written.", [(String::new(), failing)]);
}

fn family(page: &mut String, name: &str, kind: &str, help: &str, samples: impl IntoIterator<Item = (String, f64)>) {
    let _ = writeln!(page, "# HELP slamd_{name} {help}\n# TYPE slamd_{name} {kind}");
    for (labels, value) in samples {
        // Rust writes NaN as Prometheus reads it.
        let _ = writeln!(page, "slamd_{name}{labels} {value}");
    }
}
