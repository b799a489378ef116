//! Modules that read foreign bytes deny the lints that could let them panic, and no crate has unsafe code.
//!
//! A lint at the head of a module holds for all of its files. Where one cannot hold, `#[expect]` names it beside the proof.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;

/// The heads of the input path: line, captures, imports, sessions, maps, configuration, ports.
const INPUT_PATH: &[&str] = &[
    "protocol/src/lib.rs",
    "crates/capture/src/lib.rs",
    "crates/core/src/align/mod.rs",
    "crates/core/src/board.rs",
    "crates/core/src/config.rs",
    "crates/core/src/conversation.rs",
    "crates/core/src/driver.rs",
    "crates/core/src/handshake.rs",
    "crates/core/src/link.rs",
    "crates/core/src/localize/known_map.rs",
    "crates/core/src/pipeline.rs",
    "crates/core/src/saved_state.rs",
    "crates/core/src/settings.rs",
    "crates/core/src/snapshot.rs",
    "crates/core/src/sweep.rs",
    "crates/core/src/time.rs",
    "crates/eval/src/import/mod.rs",
    "src/inspect.rs",
    "src/port/mod.rs",
    "src/recorder/mod.rs",
    "src/session_file/mod.rs",
    "src/source/mod.rs",
];
/// What each of them denies.
const DENIED: &[&str] = &[
    "clippy::unwrap_used",
    "clippy::expect_used",
    "clippy::panic",
    "clippy::indexing_slicing",
    "clippy::string_slice",
    "clippy::cast_possible_truncation",
    "clippy::cast_possible_wrap",
    "clippy::cast_sign_loss",
    "clippy::allow_attributes",
    "clippy::allow_attributes_without_reason",
];
/// The lint tables that forbid unsafe code.
const CRATES: &[(&str, &str)] = &[
    ("Cargo.toml", "[workspace.lints.rust]\nunsafe_code = \"forbid\"\n"),
    ("fleet/Cargo.toml", "[lints.rust]\nunsafe_code = \"forbid\"\n"),
    // What libFuzzer's macro makes is unsafe; what we write is not.
    ("fuzz/Cargo.toml", "[lints.rust]\nunsafe_code = \"deny\"\n"),
];
/// Every member takes the workspace's lints: its binaries, tests, benches and examples, too.
const WORKSPACE_LINTS: &str = "\n[lints]\nworkspace = true\n";

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// The denied lints that the head of a file lacks.
fn lacking(text: &str) -> Vec<&'static str> {
    let denials = text.lines().filter_map(|line| line.strip_prefix("#![deny(")?.strip_suffix(")]"));
    let denied: Vec<&str> = denials.flat_map(|list| list.split(", ")).collect();
    DENIED.iter().filter(|lint| !denied.contains(lint)).copied().collect()
}

#[test]
fn the_input_path_carries_the_lints() {
    let complaints: Vec<String> = INPUT_PATH
        .iter()
        .map(|path| (path, lacking(&read(path))))
        .filter(|(_, lacking)| !lacking.is_empty())
        .map(|(path, lacking)| format!("{path}: lacks {}", lacking.join(", ")))
        .collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn no_crate_is_unsafe_and_overflow_is_checked() {
    for (path, words) in CRATES {
        assert!(read(path).contains(words), "{path}: lacks {words:?}");
    }
    let members = std::fs::read_dir(slamd_testkit::root().join("crates")).unwrap();
    let members = members.map(|entry| format!("crates/{}/Cargo.toml", entry.unwrap().file_name().to_str().unwrap()));
    let members: Vec<String> =
        members.chain(["Cargo.toml", "protocol/Cargo.toml", "xtask/Cargo.toml"].map(str::to_owned)).collect();
    assert!(members.len() > 10, "{members:?}");
    for path in members {
        assert!(read(&path).contains(WORKSPACE_LINTS), "{path}: lacks {WORKSPACE_LINTS:?}");
    }
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let checks = |profile: &str| manifest["profile"][profile].get("overflow-checks").and_then(toml::Value::as_bool);
    assert_eq!(checks("release"), Some(true));
    assert_ne!(checks("small"), Some(false));
}

#[test]
fn a_breach_is_noticed() {
    assert_eq!(lacking("").len(), DENIED.len());
    let whole = format!("//! Words.\n\n#![deny({})]\n", DENIED.join(", "));
    assert!(lacking(&whole).is_empty());
    assert_eq!(lacking(&whole.replace("clippy::expect_used, ", "")), ["clippy::expect_used"]);
    assert_eq!(lacking(&whole.replace("#![deny", "// #![deny")).len(), DENIED.len());
}
