//! What slamd's tests, benches, fuzz targets and long runs share.
//!
//! The feature `daemon` adds what needs the daemon's own crate or the built program.

#![allow(missing_docs, reason = "test support: names and tests say what a field is")]
#![allow(unreachable_pub, reason = "the parts of a module are its own")]
#![allow(clippy::unwrap_used, reason = "in a test, a failure is a panic")]

pub mod broken;
pub mod known_building;
pub mod lattice;
pub mod odd_board;
pub mod plain_drive;
pub mod promises;
pub mod python;

#[cfg(feature = "daemon")]
pub mod driving;
#[cfg(feature = "daemon")]
pub mod faulty_disk;
#[cfg(feature = "daemon")]
pub mod fuzzing;
#[cfg(feature = "daemon")]
pub mod haste;
#[cfg(feature = "daemon")]
pub mod killing;
#[cfg(feature = "daemon")]
pub mod mock_port;
#[cfg(feature = "daemon")]
pub mod mosquitto;
#[cfg(feature = "daemon")]
pub mod player;
#[cfg(feature = "daemon")]
pub mod served;
#[cfg(feature = "daemon")]
pub mod simulating;

use std::path::{Path, PathBuf};

/// The repository's root.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("crates/testkit is two levels deep")
}

/// The built program: Cargo names it to tests and benches; others find it beside themselves.
///
/// # Panics
/// Where it is not built.
#[must_use]
pub fn program() -> PathBuf {
    if let Some(path) = std::env::var_os("CARGO_BIN_EXE_slamd") {
        return path.into();
    }
    let here = std::env::current_exe().expect("a program has a path");
    let folders = here.ancestors().skip(1).take(2);
    let beside = folders.map(|folder| folder.join("slamd")).find(|path| path.is_file());
    beside.unwrap_or_else(|| panic!("no slamd beside {}: `cargo build` first", here.display()))
}
