//! A serial line: frames whose checksums hold, and noise.
#![no_main]

#[path = "../../tests/fuzzing/mod.rs"]
mod fuzzing;

libfuzzer_sys::fuzz_target!(|pieces: &[u8]| {
    fuzzing::line(pieces, &fuzzing::ring_config());
});
