//! A serial line: frames with valid checksums, and noise.
#![no_main]

#[path = "../../tests/fuzzing/mod.rs"]
mod fuzzing;

libfuzzer_sys::fuzz_target!(|pieces: &[u8]| {
    fuzzing::line(pieces, &fuzzing::ring_config());
});
