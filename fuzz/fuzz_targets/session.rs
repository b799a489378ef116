//! A session file, as it is and with a valid checksum.
#![no_main]

use slamd_testkit::fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::read_session(bytes);
    fuzzing::read_sealed_session(bytes);
});
