//! The site's map on disk, beside what was told of it.

use crate::site::Site;
use sha2::{Digest as _, Sha256};
use slamd_files::{WriteError, write_file};
use slamd_publish::{grey_png, write_map};
use std::io;
use std::path::Path;

/// Writes `merged.map` (the sums), `merged.pgm`, `merged.yaml` and `merged.png`, each whole or not at all; gives the SHA-256 of the sums.
///
/// # Errors
/// Where a file cannot be written, or the robots' maps lie too far from each other for one picture.
pub fn write(folder: &Path, site: &Site) -> Result<String, WriteError> {
    let sums = site.merged.encode();
    let failure = |text: String| WriteError { path: folder.join("merged.pgm"), source: io::Error::other(text) };
    let raster = site.merged.raster().map_err(|error| failure(error.to_string()))?;
    write_file(folder, "merged.map", &sums)?;
    write_map(folder, "merged", &raster)?;
    if !raster.occupancy.is_empty() {
        write_file(folder, "merged.png", &grey_png(&raster).map_err(|error| failure(error.to_string()))?)?;
    }
    Ok(hex(&Sha256::digest(&sums)))
}

/// Bytes in hexadecimal.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
