//! The map of a session file: resumed, then inspected.
#![no_main]

use slamd_testkit::fuzzing;
use slamd_testkit::fuzzing::Corpus;
use slamd_core::SavedState;
use std::sync::LazyLock;

static SESSION: LazyLock<SavedState> = LazyLock::new(|| Corpus::build().saved_state());

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::read_map(bytes, SESSION.clone());
});
