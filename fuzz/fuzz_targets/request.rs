//! The bytes that a client sends to the API.
#![no_main]

use slamd_testkit::fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let [first, requests @ ..] = bytes {
        fuzzing::read_requests_of_a_client(requests, first % 4 == 0, 1 + usize::from(first / 4));
    }
});
