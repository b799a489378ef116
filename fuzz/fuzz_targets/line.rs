//! A serial line: frames whose checksums hold, and noise.
#![no_main]

use slamd_testkit::fuzzing;

libfuzzer_sys::fuzz_target!(|pieces: &[u8]| {
    fuzzing::line(pieces, &fuzzing::ring_config());
});
