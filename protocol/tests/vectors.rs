//! The golden vectors: bytes → message → the same bytes; bad bytes give the expected error.

#![allow(clippy::unwrap_used, reason = "a test may")]

use serde::Deserialize;
use slamd_protocol::{FrameDecoder, FrameEncoder, Message, encode_frame};
use std::path::Path;

#[derive(Deserialize)]
struct Vector {
    r#type: Option<u8>,
    seq: Option<u8>,
    payload: Option<String>,
    frame: String,
    error: Option<String>,
}

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

/// The one frame in `bytes` as type, number and payload, and the decoder's counts.
fn decode(bytes: &[u8]) -> (Option<(u8, u8, Vec<u8>)>, slamd_protocol::DecoderCounters) {
    let mut decoder = FrameDecoder::new();
    let mut found = None;
    for &byte in bytes {
        if let Some(frame) = decoder.push(byte) {
            assert!(found.replace((frame.kind, frame.seq, frame.payload.to_vec())).is_none());
        }
    }
    (found, decoder.counters())
}

fn check_good(name: &str, vector: &Vector) {
    let frame = bytes(&vector.frame);
    let (kind, seq) = (vector.r#type.unwrap(), vector.seq.unwrap());
    let payload = bytes(vector.payload.as_deref().unwrap());
    assert_eq!(decode(&frame).0, Some((kind, seq, payload.clone())), "{name}");
    let message = Message::parse(kind, &payload).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(message.kind(), kind, "{name}");
    let mut emitted = slamd_protocol::PayloadBuf::new();
    message.emit(&mut emitted);
    assert_eq!(emitted.as_slice(), payload, "{name}");
    assert_eq!(encode_frame(kind, seq, &emitted).as_slice(), frame, "{name}");
}

fn check_bad(name: &str, vector: &Vector, error: &str) {
    let (found, counters) = decode(&bytes(&vector.frame));
    match error {
        "crc" => assert_eq!((counters.crc_errors, counters.frames), (1, 0), "{name}"),
        "malformed" => assert_eq!((counters.malformed, counters.frames), (1, 0), "{name}"),
        "message" => {
            let (kind, _, payload) = found.unwrap();
            assert!(Message::parse(kind, &payload).is_err(), "{name}");
        }
        other => panic!("{name}: unknown error {other}"),
    }
}

#[test]
fn every_vector_holds() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors");
    let mut checked = 0;
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.extension().is_some_and(|extension| extension == "toml") {
            let name = path.display().to_string();
            let vector: Vector = toml::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
            match &vector.error {
                None => check_good(&name, &vector),
                Some(error) => check_bad(&name, &vector, error),
            }
            checked += 1;
        }
    }
    assert!(checked >= 26, "{checked} vectors");
}

#[test]
fn an_encoder_numbers_its_frames() {
    let mut encoder = FrameEncoder::default();
    let numbers: Vec<u8> = (0..3).map(|_| decode(&encoder.encode(&Message::Start)).0.unwrap().1).collect();
    assert_eq!(numbers, [0, 1, 2]);
}
