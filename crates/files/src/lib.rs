//! Files that are complete or absent, that only their owner may read, and that take no other file's place unasked.

#![forbid(unsafe_code)]

mod existing;
mod folder_lock;
mod guard;
mod part_file;
pub mod private;
pub mod regular;

pub use folder_lock::{FolderLock, LockError};
pub use guard::{Output, OutputGuard, Refusal};
pub use part_file::{CompleteFile, PartFile, WriteError, complete_file, write_file};
