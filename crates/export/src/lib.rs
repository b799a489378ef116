//! A session as a ROS 2 bag: an MCAP file as rosbag2 writes it, which ROS 2, Foxglove and their kin read; ROS itself is not needed.
//!
//! `bag.rs` says what is told when, `message.rs` and `diagnostics.rs` what is in it, `schema.rs` has the messages' definitions, `cdr.rs` their bytes and
//! `file.rs` the MCAP file. `docs/export.md` is the specification.

mod bag;
mod cdr;
mod diagnostics;
mod file;
mod message;
mod odometry;
mod schema;

pub use bag::Bag;
pub use file::BagError;
