//! Who may import whom: the table of ARCHITECTURE.md, kept by machine.
//!
//! Each module names what it may use of this crate and of the crates outside it; a `use` beyond that fails here, and so does a file of more
//! than 400 lines.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::{Path, PathBuf};

/// Module, what of `crate::` it may use, whether it may touch the world (files, sockets, threads, clocks).
const TABLE: &[(&str, &[&str], bool)] = &[
    ("time", &[], false),
    ("geometry", &[], false),
    ("sweep", &["time", "geometry"], false),
    ("event", &["time", "geometry"], false),
    ("config", &["protocol", "time", "geometry", "event"], false),
    ("memory", &["time", "event"], false),
    ("align", &["protocol", "time", "geometry", "sweep", "config"], false),
    ("board", &["protocol", "geometry"], false),
    ("handshake", &["protocol", "time"], false),
    ("settings", &["protocol"], false),
    ("conversation", &["protocol", "time", "geometry", "config", "event", "board", "handshake", "settings"], false),
    ("link", &["time", "board"], false),
    ("fault", &["sweep", "time", "geometry", "config", "event", "memory"], false),
    ("orientation", &["sweep", "time", "geometry", "config", "event"], false),
    ("position", &["sweep", "time", "geometry", "config", "event", "memory"], false),
    ("mapping", &["sweep", "time", "geometry", "config", "memory"], false),
    ("walls", ESTIMATORS, false),
    ("paper", ESTIMATORS, false),
    ("localize", &["sweep", "time", "geometry", "config", "event", "memory", "position", "mapping", "walls"], false),
    ("metrics", &["time", "geometry", "event", "mapping"], false),
    (
        "pipeline",
        &[
            "protocol",
            "time",
            "geometry",
            "sweep",
            "event",
            "config",
            "align",
            "board",
            "conversation",
            "mapping",
            "memory",
            "walls",
            "paper",
            "localize",
        ],
        false,
    ),
    (
        "calibrate",
        &["time", "geometry", "event", "config", "sweep", "memory", "position", "pipeline", "capture", "metrics"],
        false,
    ),
    ("doctor", &["protocol", "time", "geometry", "event", "config", "align", "board", "link", "pipeline"], false),
    ("session_file", &["time", "memory", "priority"], true),
    ("monitor", &["time", "geometry", "event", "link", "mapping"], false),
    ("private", &[], true),
    ("capture", &["time", "geometry", "private"], true),
    ("sim", &["protocol", "time", "geometry", "config", "capture"], true),
    ("import", &["protocol", "time", "geometry", "config", "capture"], true),
    ("inspect", &["protocol", "time", "board", "capture"], true),
    ("publish", &["time", "geometry", "event", "config", "mapping", "metrics", "pipeline", "private"], true),
    (
        "source",
        &[
            "link",
            "time",
            "geometry",
            "sweep",
            "event",
            "config",
            "memory",
            "handshake",
            "pipeline",
            "capture",
            "recorder",
            "sim",
            "publish",
            "metrics",
        ],
        true,
    ),
    (
        "bench",
        &[
            "protocol", "time", "geometry", "sweep", "event", "config", "align", "mapping", "metrics", "pipeline",
            "capture", "sim", "publish",
        ],
        true,
    ),
    ("viewer", &["time", "geometry", "sweep", "event", "mapping", "metrics", "monitor", "pipeline", "source"], true),
    (
        "ros2",
        &["time", "geometry", "sweep", "event", "config", "mapping", "position", "pipeline", "source", "publish"],
        true,
    ),
    ("api", &["time", "geometry", "event", "link", "mapping", "pipeline", "private", "source", "publish"], true),
    ("mqtt", &["api", "time", "geometry", "event", "link", "mapping", "priority", "private", "publish"], true),
    ("recorder", &["time", "capture", "private"], true),
    ("service", &["time", "link", "source"], true),
    ("port", &[], true),
    ("priority", &[], true),
    ("daemon", EVERYTHING, true),
    ("cli", EVERYTHING, true),
];

const ESTIMATORS: &[&str] =
    &["sweep", "time", "geometry", "config", "event", "memory", "fault", "orientation", "position", "mapping"];
const EVERYTHING: &[&str] = &["*"];
/// What a module that may not touch the world must not name.
const WORLD: &[&str] = &[
    "std::fs",
    "std::net",
    "std::thread",
    "std::env",
    "std::process",
    "tokio",
    "tracing::",
    "Instant",
    "SystemTime",
    "rand::",
];
const MAX_LINES: usize = 400;

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            sources(&entry, into);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            into.push(entry);
        }
    }
}

/// The code of a file without its unit tests and comments.
fn code(text: &str) -> String {
    let lines = text.lines().take_while(|line| !line.starts_with("#[cfg(test)]"));
    lines.map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The modules of this crate that the code names after `crate::`, and `protocol`.
fn used(code: &str) -> Vec<String> {
    let mut found: Vec<String> = code
        .split("crate::")
        .skip(1)
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or_default().split(',').map(first_word).collect(),
            None => vec![first_word(rest)],
        })
        .filter(|word| !word.is_empty())
        .collect();
    if code.contains("slamd_protocol") {
        found.push("protocol".into());
    }
    found
}

fn first_word(text: &str) -> String {
    text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

fn complaints(module: &str, path: &Path, text: &str) -> Vec<String> {
    let name = path.display();
    let Some((_, allowed, world)) = TABLE.iter().find(|(listed, ..)| *listed == module) else {
        return vec![format!("{name}: module `{module}` is not in the table")];
    };
    let code = code(text);
    let may = |word: &str| word == module || *allowed == ["*"] || allowed.contains(&word);
    let mut complaints: Vec<String> = used(&code)
        .iter()
        .filter(|word| !may(word))
        .map(|word| format!("{name}: `{module}` may not use `{word}`"))
        .collect();
    if !world {
        let touched = WORLD.iter().filter(|word| code.contains(**word));
        complaints.extend(touched.map(|word| format!("{name}: `{module}` may not touch the world: `{word}`")));
    }
    complaints
}

#[test]
fn every_module_keeps_to_the_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut found = Vec::new();
    for path in &files {
        let inside = path.strip_prefix(&root).unwrap();
        let module = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        let text = std::fs::read_to_string(path).unwrap();
        if text.lines().count() > MAX_LINES {
            found.push(format!("{}: more than {MAX_LINES} lines", path.display()));
        }
        if module != "lib" && module != "main" {
            found.extend(complaints(module, inside, &text));
        }
    }
    assert!(files.len() > 20, "the sources were not found");
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn a_breach_is_noticed() {
    let path = Path::new("fault/detector.rs");
    assert_eq!(complaints("fault", path, "use slamd_core::position::filter::Filter;\n").len(), 1);
    assert_eq!(complaints("fault", path, "use crate::{sweep::Sweep, mapping::grid::Grid};\n").len(), 1);
    assert_eq!(complaints("sim", path, "use slamd_core::position::beam_model::sight;\n").len(), 1);
    assert_eq!(complaints("capture", path, "use slamd_protocol::Message;\n").len(), 1);
    assert_eq!(complaints("pipeline", path, "let now = std::time::Instant::now();\n").len(), 1);
    assert_eq!(complaints("nowhere", path, "").len(), 1);
    assert!(complaints("fault", path, "use slamd_core::sweep::Sweep; // slamd_core::position\n").is_empty());
}
