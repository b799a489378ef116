//! Session files: what is written is read, each damage is named, no bytes make a panic.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::session_file::{HEADER, SessionFileError, decode, encode, read, write};
use slamd_core::{
    Calibration, FaultKind, SavedState, SensorState,
    saved_state::{FilterState, FoundRobot, InactiveLandmarkState, LandmarkState, MapState, SensorHistory, TileState},
};

fn saved_state() -> SavedState {
    let wall = LandmarkState { side: 2, lo_m: -1.5, hi_m: 0.1 + 0.2, hits: 77 };
    SavedState {
        filter: FilterState {
            robot: vec![0.1, -2.0, 3.1, 0.004, -0.01],
            offsets_m: vec![1.25],
            covariance: (0..21).map(|i| 1e-3 * f64::from(i)).collect(),
            nominal: Calibration {
                wheel_ratio: 1.0,
                wheel_ratio_sigma: 0.012,
                wheel_base_m: 0.26,
                wheel_base_sigma_m: 0.006,
            },
        },
        walls: vec![wall],
        inactive: vec![InactiveLandmarkState { wall, offset_m: 9.0, variance: 4e-4 }],
        map: MapState {
            cell_m: 0.05,
            tiles: vec![TileState {
                column: -3,
                row: 7,
                log_odds: (-320..400).map(|v: i16| v).chain([0; 304]).collect(),
                normal: (0..32).map(|row| [1 << row, 0x8000_0001]).collect(),
            }],
        },
        sensors: vec![
            SensorHistory { state: SensorState::Healthy, recurrences: 0.25 },
            SensorHistory { state: SensorState::Faulty(FaultKind::Noisy), recurrences: 2.0 },
        ],
        robot: FoundRobot { travel: 0.25, turn: 0.25, ring_rad: 0.0, range: 1.0, configured: vec![0.035, 1440.0] },
    }
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flat.session");
    write(&path, &saved_state()).unwrap();
    assert_eq!(read(&path).unwrap(), saved_state());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no other file is left behind");
}

#[test]
fn each_damage_is_named() {
    let good = encode(&saved_state());
    let error = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = good.clone();
        change(&mut bytes);
        decode(&bytes).unwrap_err().to_string()
    };
    assert!(error(&|b| b[0] = b'S').starts_with("it is no session file: it begins with [53, 6c,"));
    assert!(error(&|b| b.clear()).starts_with("it is no session file"));
    assert!(
        error(&|b| b[8] = 9)
            .contains("version 9, and this program reads versions 1 to 2: the file is from a newer slamd")
    );
    assert!(
        error(&|b| b[8] = 0)
            .contains("version 0, and this program reads versions 1 to 2: the file is from an older slamd")
    );
    let whole = good.len();
    assert!(error(&|b| b.truncate(100)).contains(&format!("it has {whole} bytes, and ends after 100")));
    assert!(error(&|b| b.truncate(10)).contains("it has 24 bytes, and ends after 10"));
    assert_eq!(error(&|b| b.push(0)), format!("1 bytes follow its end at byte {whole}"));
    assert!(error(&|b| *b.last_mut().unwrap() ^= 1).contains("its checksum says 0x"));
    assert!(error(&|b| b[20] ^= 1).contains("damaged"));
}

/// Bytes with a checksum that holds, so that what is behind it is reached.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    if bytes.len() >= HEADER {
        let length = (bytes.len() - HEADER) as u64;
        bytes[12..20].copy_from_slice(&length.to_le_bytes());
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
        let crc = crc.checksum(&[&bytes[8..20], &bytes[HEADER..]].concat());
        bytes[20..24].copy_from_slice(&crc.to_le_bytes());
    }
    bytes
}

#[test]
fn a_file_of_version_1_is_read() {
    let state = SavedState { robot: FoundRobot::default(), ..saved_state() };
    let mut bytes = encode(&state);
    // Version 1 ends before the robot: four numbers and an empty list.
    bytes.truncate(bytes.len() - 33);
    bytes[8] = 1;
    assert_eq!(decode(&resealed(bytes)), Ok(state));
}

#[test]
fn a_length_is_not_trusted() {
    let mut bytes = encode(&saved_state());
    // The first field is a list: make its length 2^63.
    bytes.splice(HEADER..=HEADER, [0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x01]);
    let error = decode(&resealed(bytes)).unwrap_err();
    assert!(matches!(error, SessionFileError::Content(_)), "{error}");
}

#[test]
fn no_mutation_panics() {
    let good = encode(&saved_state());
    let mut random = 0x1234_5678_9ABC_DEF1_u64;
    let mut next = |below: usize| {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        usize::try_from(random >> 33).unwrap() % below.max(1)
    };
    let (mut refused, mut read) = (0, 0);
    for round in 0..6_000 {
        let mut bytes = good.clone();
        for _ in 0..=next(3) {
            match next(4) {
                0 => bytes.truncate(next(good.len())),
                1 => bytes.extend(vec![0xA5; next(40)]),
                _ => {
                    // Most of the file is a tile; what is in front of it is where the lengths are.
                    let place = if next(2) == 0 { next(bytes.len()) } else { next(bytes.len().min(300)) };
                    if let Some(byte) = bytes.get_mut(place) {
                        *byte = u8::try_from(next(256)).unwrap();
                    }
                }
            }
        }
        let bytes = if round % 2 == 0 { resealed(bytes) } else { bytes };
        match decode(&bytes) {
            Ok(memory) => {
                // What no session holds is refused by the stages, in words.
                let ring = slamd_core::Ring::default();
                let _ = slamd_core::stages::WallSlam::resume(&slamd_core::Config::default(), &ring, &memory);
                read += 1;
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                refused += 1;
            }
        }
    }
    assert!(refused > 3_000 && read > 300, "{refused} refused, {read} read");
}
