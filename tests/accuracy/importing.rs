//! Texts as captures, without options and over whatever is there.

#![expect(clippy::unwrap_used, reason = "a test")]

use slamd_core::Config;
use slamd_eval::import::{ImportError, Options, Summary, carmen, ring};
use slamd_files::{Output, OutputGuard};
use std::path::Path;

/// Imports a CSV file of a ring.
pub(crate) fn ring_import(csv: &[u8], file: &str, config: &Config, capture: &Path) -> Result<Summary, ImportError> {
    ring::read(csv, file, config, &Options::default())?.write(output(capture))
}

/// Imports a CARMEN log.
pub(crate) fn carmen_import(log: &[u8], file: &str, config: &Config, capture: &Path) -> Result<Summary, ImportError> {
    carmen::read(log, file, config, &Options::default())?.write(output(capture))
}

fn output(capture: &Path) -> Output {
    OutputGuard::new(true).output(capture).unwrap()
}
