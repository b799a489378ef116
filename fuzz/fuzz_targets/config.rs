//! A robot's configuration, then a drive with it.
#![no_main]

use slamd_testkit::fuzzing;
use slamd_testkit::fuzzing::Corpus;
use std::sync::LazyLock;

static CORPUS: LazyLock<Corpus> = LazyLock::new(Corpus::build);

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzzing::read_config(text, CORPUS.start());
});
