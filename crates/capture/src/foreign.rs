//! What an MCAP file is that is no capture.

use super::{CaptureError, RECEIVED_TOPIC};
use std::path::Path;

/// What has been seen of a file without slamd's description.
pub(super) struct Seen<'a> {
    /// The MCAP profile, once it is known.
    pub(super) profile: Option<&'a str>,
    /// The first topics.
    pub(super) topics: &'a [String],
    /// Its chunks cannot be read.
    pub(super) is_compressed: bool,
}

/// What to do about a file that begins with other bytes than an MCAP file.
pub(super) fn hint(begin: &[u8]) -> &'static str {
    let is_text = begin.iter().all(|byte| byte.is_ascii_graphic() || b" \t\r\n".contains(byte));
    if begin.starts_with(b"SQLite") {
        "; `slamd import bag` reads ROS 2 bags"
    } else if begin.starts_with(b"\x1f\x8b") {
        "; it is packed with gzip: unpack it, or `slamd import ring` reads a packed CSV"
    } else if is_text {
        "; it is a text: `slamd import ring` makes a capture of a CSV, `slamd import carmen` of a CARMEN log"
    } else {
        ""
    }
}

/// Enough topics to recognize a file by.
pub(super) const MAX_TOPICS: usize = 5;
/// The profile of captures.
const PROFILE: &str = "slamd";
/// Larger files are not read whole for their list of topics, bytes: the profile names them.
const MAX_READ: u64 = 64 << 20;

impl Seen<'_> {
    /// Why the file is no capture; none if it may be the beginning of one.
    pub(super) fn complaint(&self, path: &Path) -> Option<CaptureError> {
        let profile = self.profile.unwrap_or(PROFILE);
        let listed = if self.is_compressed { listed_topics(path) } else { Vec::new() };
        let topics = if listed.is_empty() { self.topics } else { &listed };
        if topics.iter().any(|topic| topic == RECEIVED_TOPIC) {
            return Some(CaptureError::Undescribed(path.into()));
        }
        // A recorder that was killed at once has written no more than the profile.
        if profile == PROFILE && topics.is_empty() {
            return None;
        }
        let (what, hint) = match profile {
            "ros2" => ("a ROS 2 bag (profile ros2)".into(), ROS_2),
            "ros1" => ("a ROS 1 bag (profile ros1)".into(), ROS_1),
            "" | PROFILE => {
                let names = topics.iter().take(MAX_TOPICS).cloned().collect::<Vec<_>>().join(", ");
                (format!("another program's MCAP file ({})", if names.is_empty() { "no topics" } else { &names }), "")
            }
            other => (format!("another program's MCAP file (profile {other})"), ""),
        };
        Some(CaptureError::Foreign { path: path.into(), what, hint })
    }
}

const ROS_2: &str = "; it may be what `slamd export` wrote; `slamd import bag` makes a capture of a robot's bag";
const ROS_1: &str = "; convert it to ROS 2, and `slamd import bag` reads it";

/// The topics that the file's summary lists.
fn listed_topics(path: &Path) -> Vec<String> {
    let is_small = std::fs::metadata(path).is_ok_and(|metadata| metadata.len() <= MAX_READ);
    let bytes = if is_small { std::fs::read(path).unwrap_or_default() } else { Vec::new() };
    let summary = mcap::Summary::read(&bytes).ok().flatten();
    summary.map(|summary| summary.channels.values().map(|channel| channel.topic.clone()).collect()).unwrap_or_default()
}
