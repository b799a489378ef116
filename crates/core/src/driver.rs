//! What drives a pipeline: a session's records, and who watches it.

use crate::event::Event;
use crate::geometry::Pose2;
use crate::pipeline::Pipeline;
use crate::time::Timestamp;
use std::time::Duration;

/// One message of a capture, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// Bytes read from the board.
    Received {
        /// When the read returned.
        at: Timestamp,
        /// The chunk, exactly as read.
        bytes: Vec<u8>,
    },
    /// Bytes written to the board.
    Sent {
        /// When the write returned.
        at: Timestamp,
        /// The chunk, exactly as written.
        bytes: Vec<u8>,
    },
    /// Where the robot truly was.
    Truth {
        /// When.
        at: Timestamp,
        /// `world_from_robot`.
        pose: Pose2,
    },
}

impl Record {
    /// The record's time.
    #[must_use]
    pub const fn at(&self) -> Timestamp {
        match self {
            Self::Received { at, .. } | Self::Sent { at, .. } | Self::Truth { at, .. } => *at,
        }
    }
}

/// Something that somebody who watches a session gets to see, as it happens.
#[derive(Clone, Copy, Debug)]
pub enum Update<'a> {
    /// An event of the pipeline.
    Event(&'a Event),
    /// Where the robot truly was.
    Truth(Timestamp, Pose2),
    /// An input has been used up; its events have been shown before.
    Input,
}

/// What it happens in.
pub struct Context<'a> {
    /// The pipeline after the input that caused it.
    pub pipeline: &'a Pipeline,
    /// Session time.
    pub now: Timestamp,
    /// How long the pipeline took for that input.
    pub took: Duration,
}

/// Sees all that happens in a session, and must not wait.
pub type Watcher = Box<dyn FnMut(&Context<'_>, Update<'_>)>;
