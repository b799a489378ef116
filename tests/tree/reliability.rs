//! Each promise names a test that exists, and `docs/reliability.md` says how it fared.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::promises::{LONG, PROMISES};
use std::path::Path;

#[test]
fn each_promise_names_its_test_and_is_on_the_page() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let told = std::fs::read_to_string(root.join("docs/reliability.md")).unwrap();
    for promise in &PROMISES {
        let (file, name) = promise.test;
        let source = std::fs::read_to_string(root.join(file)).unwrap();
        let head = source.split(&format!("\nfn {name}()")).next().filter(|head| head.len() < source.len());
        let attributes = head.and_then(|head| head.rsplit("\n\n").next()).unwrap_or_default();
        assert!(attributes.contains("#[test]"), "{file} has no test {name}");
        assert!(promise.long_run.is_none_or(|task| LONG.iter().any(|run| run.name == task)), "{}", promise.says);
        assert!(
            told.contains(promise.says) && told.contains(name),
            "docs/reliability.md is older than: {}",
            promise.says
        );
    }
    assert!(!told.contains("**broken**") && !told.contains("**Broken**"), "a promise is told to be broken");
}
