//! The estimator of slamd: bytes and time in, poses, faults and a map out.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`
//!
//! The crate opens no port, no file and no socket, reads no clock and starts no thread. A program gives it what was read and written and
//! when; so live, replay and test run the same code.
//!
//! # The run loop
//!
//! 1. Make a [`Pipeline`] of a [`Config`], and a [`Driver`] of the pipeline.
//! 2. Hand in each [`Record`] of a session in order: [`Driver::feed`]. The observer sees every [`Update`] at once: events, and frames for
//!    the board.
//! 3. With a live board, also call [`Driver::advance`] at [`Driver::next_deadline`], and write the frames of [`Update::Transmit`].
//! 4. At the end call [`Driver::end`]: the first sweeps may still wait for the building's axis.
//!
//! **Invariant:** every deadline that is due before an input is handled first, at its own time, and all that an input causes is drained
//! before the next. The same records therefore give the same events, poses and map, bit for bit, on every machine.
//!
//! ```
//! use slamd_core::{Config, Driver, Event, Pipeline, Record, Start, Timestamp, Update};
//!
//! let mut driver = Driver::new(Pipeline::new(&Config::default(), Start::Fresh)?);
//! let records = [Record::Received { at: Timestamp::from_us(1_000), bytes: vec![0; 8] }];
//! let mut poses = Vec::new();
//! for record in &records {
//!     driver.feed(record, |_, update| {
//!         if let Update::Event(Event::Estimate(estimate)) = update {
//!             poses.push(estimate.pose);
//!         }
//!     });
//! }
//! driver.end(|_, _| {});
//! assert!(poses.is_empty(), "eight bytes are no sweep");
//! assert!(driver.pipeline().raster().occupancy.is_empty());
//! # Ok::<(), slamd_core::InvalidState>(())
//! ```
//!
//! `examples/replay.rs` maps a whole capture. Frames and units: REP-103 (x forward, y left, counter-clockwise, metres, radians), REP-105
//! (`odom`, `map`), REP-117 (+∞ nothing in range, −∞ too close, NaN no measurement).

#![forbid(unsafe_code)]

mod align;
mod board;
pub mod config;
mod conversation;
mod driver;
mod event;
mod fault;
mod geometry;
mod handshake;
pub mod link;
mod localize;
mod mapping;
mod orientation;
mod params;
mod pipeline;
mod position;
mod rates;
mod robot_model;
pub mod saved_state;
mod session_clock;
mod settings;
mod snapshot;
pub mod stages;
mod sweep;
mod time;
mod wall_slam;

pub use board::Board;
pub use config::{Config, ConfigError, Method};
pub use driver::{Context, Driver, Record, Update, Watcher};
pub use event::{
    Calibration, Counters, EncoderEvent, EncoderState, Estimate, Event, FaultEvent, FaultKind, Input, KnownMapSearch,
    LocalizationChange, LocalizationEvent, Output, SearchState, SensorState, UnknownFaultKind, Verdict, Wheel,
};
pub use geometry::{Mounting, Placement, Point, Pose2, Ring, Segment, nearest_quarter, sinc, wrap_angle};
pub use handshake::introduction;
pub use mapping::grid::{MapChange, Patch};
pub use mapping::raster::Raster;
pub use pipeline::{Estimator, Methods, Pipeline, Start, Topic, Waiting, built_in};
pub use rates::{RateMeter, Rates};
pub use robot_model::{ModelAspect, ModelEvent, ModelFinding, ModelState};
pub use saved_state::{InvalidState, SavedState};
pub use snapshot::{SessionState, Snapshot};
pub use sweep::{Beam, NoMeasurement, Sweep};
pub use time::{DeviceTime, Timestamp};
