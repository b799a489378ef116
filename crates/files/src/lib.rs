//! Files that are complete or absent, and that only their owner may read.

#![forbid(unsafe_code)]

mod part_file;
pub mod private;

pub use part_file::{PartFile, WriteError, write_file};
