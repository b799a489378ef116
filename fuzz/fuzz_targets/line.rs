//! A serial line: frames with valid checksums, and noise.
#![no_main]

use slamd_testkit::fuzzing;

libfuzzer_sys::fuzz_target!(|pieces: &[u8]| {
    fuzzing::line(pieces, &fuzzing::ring_config());
});
