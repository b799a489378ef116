//! Writes a session as a ROS 2 bag: an MCAP file as rosbag2 writes it, for ROS 2 and Foxglove. ROS
//! itself is not needed.
//!
//! `bag.rs` decides which message is written when, `message.rs`, `scan.rs`, `path.rs`, `description.rs`
//! and `diagnostics.rs` make the messages, `schema.rs` has their definitions, `cdr.rs` their serialization, and `file.rs` the MCAP
//! file. `docs/export.md` is the specification.

mod bag;
mod cdr;
mod description;
mod diagnostics;
mod file;
mod message;
mod odometry;
mod path;
mod scan;
mod schema;

pub use bag::Bag;
pub use file::BagError;
