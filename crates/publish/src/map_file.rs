//! `map.pgm` and `map.yaml` in the trinary convention of ROS map_server: white is free, black occupied, grey unknown.
//!
//! map_server takes a pixel p as the probability (255 − p) / 255: occupied above 0.65, free below 0.196, else unknown. The
//! unknown grey 205 is 0.19608, just not free; with the widespread `free_thresh: 0.25` it would be.

use super::WriteError;
use slamd_core::Raster;
use slamd_files::{CompleteFile, complete_file};
use std::path::Path;

/// Occupied from here on, percent.
pub const OCCUPIED_PERCENT: i8 = 65;
/// Free up to here, percent.
pub const FREE_PERCENT: i8 = 19;

/// Writes `NAME.pgm` and `NAME.yaml` and returns the SHA-256 of the picture.
///
/// # Errors
/// When one of them cannot be written.
pub fn write_map(folder: &Path, name: &str, raster: &Raster) -> Result<String, WriteError> {
    let [pgm, yaml] = map_files(folder, name, raster)?;
    let sha256 = pgm.name()?;
    yaml.name()?;
    Ok(sha256)
}

/// The same two files, still under temporary names.
pub(super) fn map_files(folder: &Path, name: &str, raster: &Raster) -> Result<[CompleteFile; 2], WriteError> {
    Ok([
        complete_file(folder, &format!("{name}.pgm"), &pgm(raster))?,
        complete_file(folder, &format!("{name}.yaml"), yaml(name, raster).as_bytes())?,
    ])
}

/// A binary PGM; a raster without cells becomes one unknown cell, because readers refuse empty pictures.
fn pgm(raster: &Raster) -> Vec<u8> {
    let (width, height) = (raster.width.max(1), raster.height.max(1));
    let mut file = format!("P5\n{width} {height}\n255\n").into_bytes();
    let header = file.len();
    // Pictures begin at the top, rasters at the bottom.
    for row in raster.occupancy.chunks_exact(width).rev() {
        file.extend(row.iter().map(|&percent| grey(percent)));
    }
    file.resize(header + width * height, UNKNOWN);
    file
}

/// The grey of a cell of a raster.
#[must_use]
pub const fn grey(percent: i8) -> u8 {
    match percent {
        0..=FREE_PERCENT => FREE,
        OCCUPIED_PERCENT.. => OCCUPIED,
        _ => UNKNOWN,
    }
}

/// A grey PNG, 8 bits, the top row first, with the greys of the PGM.
///
/// # Errors
/// Where the raster is too wide for the format, or has no cells.
pub fn grey_png(raster: &Raster) -> Result<Vec<u8>, png::EncodingError> {
    let side = |cells: usize| u32::try_from(cells).map_err(|_| png::EncodingError::LimitsExceeded);
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, side(raster.width)?, side(raster.height)?);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let rows = raster.occupancy.chunks_exact(raster.width.max(1)).rev().flatten();
    let pixels: Vec<u8> = rows.map(|&percent| grey(percent)).collect();
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(file)
}

fn yaml(name: &str, raster: &Raster) -> String {
    format!(
        "image: {name}.pgm\nmode: trinary\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        if raster.cell_m > 0.0 { raster.cell_m } else { 0.05 },
        raster.origin.x,
        raster.origin.y
    )
}

const FREE: u8 = 254;
const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::Point;

    /// map_server's rule, from `map_io.cpp`.
    fn map_server(pixel: u8) -> i8 {
        let occupancy = f64::from(255 - pixel) / 255.0;
        if occupancy > 0.65 {
            100
        } else if occupancy < 0.196 {
            0
        } else {
            -1
        }
    }

    #[test]
    fn map_server_reads_back_every_class_in_its_place() {
        let occupancy = vec![-1, 0, 19, 20, 64, 65];
        let raster = Raster { width: 3, height: 2, cell_m: 0.05, origin: Point::new(-1.5, 2.0), occupancy };
        let file = pgm(&raster);
        let pixels = file.strip_prefix(b"P5\n3 2\n255\n").unwrap();
        let read: Vec<i8> = pixels.iter().map(|&pixel| map_server(pixel)).collect();
        assert_eq!(read, [-1, -1, 100, -1, 0, 0], "the upper row comes first");
        let text = yaml("map", &raster);
        assert!(text.contains("resolution: 0.05\norigin: [-1.5, 2, 0.0]\n"), "{text}");
    }

    #[test]
    fn an_empty_raster_is_one_unknown_cell() {
        assert_eq!(pgm(&Raster::default()), b"P5\n1 1\n255\n\xcd");
    }
}
