//! The map of a session file: resumed, then inspected.
#![no_main]

#[path = "../../tests/fuzzing/mod.rs"]
mod fuzzing;

use fuzzing::Corpus;
use slamd::memory::Memory;
use std::sync::LazyLock;

static SESSION: LazyLock<Memory> = LazyLock::new(|| Corpus::new().memory());

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzzing::read_map(bytes, SESSION.clone());
});
