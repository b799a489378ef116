//! Files that appear whole or not at all, and that only their owner may read.

#![forbid(unsafe_code)]

mod part_file;
pub mod private;

pub use part_file::{PartFile, WriteError, write_file};
