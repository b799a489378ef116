//! A session file, as it is and behind a checksum that holds.
#![no_main]

use slamd_testkit::fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::read_session(bytes);
    fuzzing::read_sealed_session(bytes);
});
