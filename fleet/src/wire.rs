//! What goes over the network: poses, sweeps and status as JSON, maps and pieces of captures as a version byte and postcard.
//!
//! Each kind carries [`VERSION`]; another version is refused. Whatever comes from the network is checked here before it is used.

use crate::session::SessionId;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use slamd_core::{
    Patch, Pose2,
    saved_state::{MapState, TileState},
    stages::OccupancyGrid,
};

/// The version of all that is below.
pub const VERSION: u8 = 1;
/// Bytes of a capture in one piece at most.
pub const MAX_PIECE: u64 = 256 << 10;
/// Sessions that a robot may offer at once.
pub const MAX_SESSIONS: usize = 1_000;
/// A map takes less: 16,384 tiles of 1,024 cells, 3 bytes each at most.
const MAX_BYTES: usize = 64 << 20;
/// Cells along a tile's side.
pub const SIDE: i32 = Patch::SIDE;
/// Cells of a tile.
pub const TILE: usize = (SIDE * SIDE).unsigned_abs() as usize;

/// Bytes that are not what they should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// Written by another version of this program.
    #[error("version {found}, and this program speaks version {VERSION}: run the same on all machines")]
    Version {
        /// What it says.
        found: u8,
    },
    /// Nothing that can be read.
    #[error("cannot be read: {0}")]
    Content(String),
}

/// The pose at one sweep: `pose`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// [`VERSION`].
    pub version: u8,
    /// The drive.
    pub session: SessionId,
    /// The sweep's number.
    pub seq: u64,
    /// Session time of the sweep, microseconds.
    pub time_us: u64,
    /// `map_from_robot`, metres in the robot's own map.
    pub x_m: f64,
    /// The same along y.
    pub y_m: f64,
    /// Radians, counter-clockwise.
    pub theta_rad: f64,
}

/// One range of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Range {
    /// A distance, metres.
    Metres(f64),
    /// `clear`: nothing in range; `near`: too close to measure.
    Word(String),
    /// No measurement.
    None,
}

/// One sweep: `sweep`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// [`VERSION`].
    pub version: u8,
    /// The drive.
    pub session: SessionId,
    /// Its number.
    pub seq: u64,
    /// Session time, microseconds.
    pub time_us: u64,
    /// By sensor.
    pub ranges: Vec<Range>,
}

/// What a robot has: `status`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// [`VERSION`].
    pub version: u8,
    /// Its captures, the oldest first; the last one is being driven.
    pub captures: Vec<Offer>,
    /// How far its newest map is: see [`Grid::seq`].
    pub map_seq: u64,
}

/// A capture that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Offer {
    /// The drive.
    pub session: SessionId,
    /// Bytes there are.
    pub bytes: u64,
    /// No more will come.
    pub is_whole: bool,
}

/// A piece of a capture: the answer to `capture?session=S;from=N`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Piece {
    /// The drive.
    pub session: SessionId,
    /// The place of its first byte.
    pub from: u64,
    /// SHA-256 of the capture from its beginning to the end of this piece: so it also says whether the bytes in front of it are right.
    pub sha256: [u8; 32],
    /// It ends where the capture does, and no more will come.
    pub is_last: bool,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A robot's map, all of it whole numbers. The order of maps is that of the fields: the greatest is the newest.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Grid {
    /// The drive.
    pub session: SessionId,
    /// Records of the capture that are in it. The same session and number are the same map.
    pub seq: u64,
    /// `map_from_robot` at the first sweep.
    pub start: Start,
    /// Side of a cell, micrometres.
    pub cell_um: u32,
    /// By column and row.
    pub tiles: Vec<Tile>,
}

/// Where a drive began in its own map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Start {
    /// Micrometres.
    pub x_um: i64,
    /// Micrometres.
    pub y_um: i64,
    /// Microradians, counter-clockwise.
    pub theta_urad: i64,
}

/// A square of cells.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Tile {
    /// Its place in tiles from the map's origin.
    pub column: i32,
    /// The same along y.
    pub row: i32,
    /// Log-odds in hundredths, row by row from the lower left; 0 where nothing is known.
    pub log_odds: Vec<i16>,
}

impl Range {
    /// A range as in REP-117.
    #[must_use]
    pub fn new(range_m: f64) -> Self {
        match range_m {
            _ if range_m.is_finite() => Self::Metres(range_m),
            f64::INFINITY => Self::Word("clear".into()),
            f64::NEG_INFINITY => Self::Word("near".into()),
            _ => Self::None,
        }
    }
}

impl Start {
    /// A pose to the micrometre.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "saturates; a robot is not so far off")]
    pub fn new(pose: Pose2) -> Self {
        let whole = |value: f64| libm::round(value * 1e6) as i64;
        Self { x_um: whole(pose.x_m), y_um: whole(pose.y_m), theta_urad: whole(pose.theta_rad) }
    }

    /// As a pose.
    #[must_use]
    pub fn pose(self) -> Pose2 {
        Pose2::new(self.x_um as f64 * 1e-6, self.y_um as f64 * 1e-6, self.theta_urad as f64 * 1e-6)
    }
}

impl Grid {
    /// The map that a pipeline remembers.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "cells are 5 mm to 1 m")]
    pub fn new(session: SessionId, seq: u64, start: Pose2, map: MapState) -> Self {
        let tile = |tile: TileState| Tile { column: tile.column, row: tile.row, log_odds: tile.log_odds };
        let cell_um = libm::round(map.cell_m * 1e6) as u32;
        Self { session, seq, start: Start::new(start), cell_um, tiles: map.tiles.into_iter().map(tile).collect() }
    }

    /// As the bytes of an answer or a file.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// From such bytes.
    ///
    /// # Errors
    /// Where they are not a map that slamd can have made.
    pub fn decode(bytes: &[u8]) -> Result<Self, WireError> {
        let grid: Self = decode(bytes)?;
        let ordered = grid.tiles.windows(2).all(|pair| (pair[0].column, pair[0].row) < (pair[1].column, pair[1].row));
        if !ordered {
            return Err(WireError::Content("the tiles are out of order".into()));
        }
        grid.occupancy().map(|_| grid)
    }

    /// The grid as slamd has it.
    ///
    /// # Errors
    /// Where slamd could not have made it.
    pub fn occupancy(&self) -> Result<OccupancyGrid, WireError> {
        let normal = vec![[0; 2]; TILE.isqrt()];
        let tile = |tile: &Tile| TileState {
            column: tile.column,
            row: tile.row,
            log_odds: tile.log_odds.clone(),
            normal: normal.clone(),
        };
        let map = MapState { cell_m: f64::from(self.cell_um) * 1e-6, tiles: self.tiles.iter().map(tile).collect() };
        OccupancyGrid::restore(&map).map_err(|error| WireError::Content(error.to_string()))
    }
}

impl Piece {
    /// As the bytes of an answer.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// From such bytes.
    ///
    /// # Errors
    /// Where they are no piece.
    pub fn decode(bytes: &[u8]) -> Result<Self, WireError> {
        decode(bytes)
    }
}

/// From JSON, where the version is right.
///
/// # Errors
/// Where it is not, or it is something else.
pub fn from_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, WireError> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u8,
    }
    let content = |error: serde_json::Error| WireError::Content(error.to_string());
    let found = serde_json::from_slice::<Versioned>(bytes).map_err(content)?.version;
    if found == VERSION { serde_json::from_slice(bytes).map_err(content) } else { Err(WireError::Version { found }) }
}

/// As JSON.
///
/// # Panics
/// Never: numbers, texts and lists have a JSON form.
#[must_use]
pub fn to_json<T: Serialize>(value: &T) -> Vec<u8> {
    serde_json::to_vec(value).expect("numbers, texts and lists")
}

fn encode<T: Serialize>(value: &T) -> Vec<u8> {
    let mut bytes = vec![VERSION];
    bytes.extend(postcard::to_allocvec(value).expect("postcard refuses only lists of unknown length"));
    bytes
}

fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, WireError> {
    match bytes.split_first() {
        Some((&VERSION, rest)) if rest.len() <= MAX_BYTES => match postcard::take_from_bytes(rest) {
            Ok((value, [])) => Ok(value),
            Ok((_, rest)) => Err(WireError::Content(format!("{} bytes follow its end", rest.len()))),
            Err(error) => Err(WireError::Content(error.to_string())),
        },
        Some((&VERSION, rest)) => Err(WireError::Content(format!("{} bytes are too many", rest.len()))),
        Some((&found, _)) => Err(WireError::Version { found }),
        None => Err(WireError::Content("it is empty".into())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid(values: &[i16]) -> Grid {
        let mut log_odds = vec![0; TILE];
        log_odds[..values.len()].copy_from_slice(values);
        let tiles = vec![Tile { column: -1, row: 2, log_odds: log_odds.clone() }, Tile { column: 0, row: 0, log_odds }];
        Grid { session: SessionId::default(), seq: 7, start: Start::default(), cell_um: 50_000, tiles }
    }

    proptest! {
        #[test]
        fn maps_come_back(values in prop::collection::vec(-320..=400i16, 0..50)) {
            let grid = grid(&values);
            prop_assert_eq!(Grid::decode(&grid.encode()), Ok(grid));
        }

        #[test]
        fn any_bytes_are_harmless(mut bytes in prop::collection::vec(any::<u8>(), 0..200), place in 0..2_000usize, byte: u8) {
            let _ = (Grid::decode(&bytes), Piece::decode(&bytes), from_json::<Status>(&bytes));
            if let Some(first) = bytes.first_mut() {
                *first = VERSION;
            }
            let _ = (Grid::decode(&bytes), Piece::decode(&bytes));
            let mut sound = grid(&[1, 2, 3]).encode();
            if let Some(changed) = sound.get_mut(place) {
                *changed = byte;
            }
            let _ = Grid::decode(&sound);
        }
    }

    #[test]
    fn maps_that_cannot_be_are_refused() {
        let mut twice = grid(&[]);
        twice.tiles.swap(0, 1);
        let mut short = grid(&[]);
        short.tiles[0].log_odds.pop();
        let mut tiny = grid(&[]);
        tiny.cell_um = 1;
        let mut later = grid(&[1]).encode();
        later[0] = 2;
        for bad in [twice.encode(), short.encode(), tiny.encode(), grid(&[401]).encode(), later] {
            assert!(Grid::decode(&bad).is_err());
        }
    }

    #[test]
    fn ranges_without_a_number_have_words() {
        let text = serde_json::to_string(&[1.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN].map(Range::new)).unwrap();
        assert_eq!(text, r#"[1.5,"clear","near",null]"#);
    }
}
