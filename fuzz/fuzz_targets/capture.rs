//! A capture file.
#![no_main]

use slamd_testkit::fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::read_capture(bytes);
});
