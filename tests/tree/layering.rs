//! Which crate uses which, what the core's modules must not touch, and how long a file may be: kept by machine.
//!
//! The compiler keeps a crate to its `Cargo.toml`; the table here keeps `Cargo.toml` to the architecture.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Folder of a crate, and the crates of this repository in its `[dependencies]`, by their names without `slamd-`. Tests may use any crate:
/// dev-dependencies are not limited.
const CRATES: &[(&str, &[&str])] = &[
    ("protocol", &[]),
    ("crates/core", &["protocol"]),
    ("crates/files", &[]),
    ("crates/capture", &["core", "files"]),
    ("crates/metrics", &["core"]),
    ("crates/paper", &["core"]),
    ("crates/publish", &["core", "files", "metrics"]),
    // The simulator shares geometry and codec with the estimator, never its models: see `FORBIDDEN`.
    ("crates/sim", &["protocol", "core", "capture"]),
    ("crates/eval", &["protocol", "core", "capture", "files", "metrics", "paper", "publish", "sim"]),
    ("crates/explore", &["core"]),
    ("crates/export", &["core", "files"]),
    ("crates/viewer", &["core", "metrics"]),
    ("crates/testkit", ANYTHING),
    ("xtask", ANYTHING),
    (".", &["protocol", "core", "files", "capture", "metrics", "paper", "publish", "sim", "eval", "export", "viewer"]),
];
const ANYTHING: &[&str] = &["*"];

/// Folder, modules in it, and what none of them may name: modules of the core, or a crate.
const FORBIDDEN: &[(&str, &[&str], &[&str])] = &[
    ("crates/core/src", &["time", "geometry", "sweep", "event"], ESTIMATORS),
    ("crates/core/src", &["config", "saved_state"], ESTIMATORS),
    // Stages know sweeps, never the wire, and not each other: a method joins them.
    ("crates/core/src", &["fault"], &["orientation", "position", "mapping", "wall_slam", "localize", "pipeline"]),
    ("crates/core/src", &["orientation"], &["fault", "position", "mapping", "wall_slam", "localize", "pipeline"]),
    ("crates/core/src", &["position"], &["fault", "orientation", "mapping", "wall_slam", "localize", "pipeline"]),
    ("crates/core/src", &["mapping"], &["fault", "orientation", "position", "wall_slam", "localize", "pipeline"]),
    ("crates/core/src", &["wall_slam"], &["localize"]),
    ("crates/core/src", &["fault", "orientation", "position", "mapping", "wall_slam", "localize"], WIRE),
    // The wire knows no estimator.
    ("crates/core/src", &["align", "board", "conversation", "handshake", "link", "settings"], ESTIMATORS),
    ("crates/paper/src", &["*"], WIRE),
    // The explorer knows poses, echoes and maps, no estimator: what it commands depends on the estimate alone.
    ("crates/explore/src", &["*"], &["stages", "pipeline", "Pipeline", "Estimator", "Driver", "slamd_protocol"]),
    // Outside the core the estimators stand behind these names.
    ("crates/sim/src", &["*"], &["stages", "pipeline", "Pipeline", "Estimator", "Driver"]),
];
const ESTIMATORS: &[&str] = &["fault", "orientation", "position", "mapping", "wall_slam", "localize", "pipeline"];
const WIRE: &[&str] = &["slamd_protocol", "align", "board", "conversation", "driver", "handshake", "link", "settings"];

/// What holds state machines only: no file, socket, thread or clock.
const SANS_IO: &[&str] = &[
    "crates/core/src",
    "crates/explore/src",
    "crates/metrics/src",
    "crates/paper/src",
    "src/calibrate",
    "src/doctor",
    "src/monitor",
    "src/setup",
];
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

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(sources(&entry));
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            found.push(entry);
        }
    }
    found
}

/// The code of a file without its unit tests and comments.
fn code(text: &str) -> String {
    let lines = text.lines().take_while(|line| !line.starts_with("#[cfg(test)]"));
    lines.map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The modules that the code names after `crate::` or `slamd_core::`.
fn used(code: &str) -> Vec<String> {
    let first_word = |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    ["crate::", "slamd_core::"]
        .iter()
        .flat_map(|path| code.split(path).skip(1))
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or_default().split(',').map(first_word).collect(),
            None => vec![first_word(rest)],
        })
        .filter(|word: &String| !word.is_empty())
        .collect()
}

/// Differences between the table and the crates of this repository that a `Cargo.toml` depends on.
fn crate_complaints(folder: &str, manifest: &str) -> Vec<String> {
    let Some((_, listed)) = CRATES.iter().find(|(listed, _)| *listed == folder) else {
        return vec![format!("{folder}: this crate is not in the table")];
    };
    if *listed == ANYTHING {
        return Vec::new();
    }
    let manifest: toml::Table = manifest.parse().unwrap();
    let dependencies = manifest.get("dependencies").and_then(toml::Value::as_table);
    let names = dependencies.into_iter().flat_map(|table| table.keys()).filter(|name| name.starts_with("slamd"));
    let used: BTreeSet<&str> = names.map(|name| name.trim_start_matches("slamd-")).collect();
    let listed: BTreeSet<&str> = listed.iter().copied().collect();
    let forbidden = used.difference(&listed).map(|name| format!("{folder}: may not depend on {name}"));
    let unused = listed.difference(&used).map(|name| format!("{folder}: the table lists {name}, Cargo.toml does not"));
    forbidden.chain(unused).collect()
}

/// What a file of a folder names and may not.
fn module_complaints(folder: &str, inside: &Path, text: &str) -> Vec<String> {
    let (code, name) = (code(text), format!("{folder}/{}", inside.display()));
    let module = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
    let rules = FORBIDDEN
        .iter()
        .filter(|(listed, modules, _)| *listed == folder && (*modules == ["*"] || modules.contains(&module)));
    let used = used(&code);
    let is_named = |word: &str| used.iter().any(|used| used == word) || word == "slamd_protocol" && code.contains(word);
    let words = rules.flat_map(|(_, _, forbidden)| *forbidden).filter(|word| is_named(word));
    words.map(|word| format!("{name}: `{module}` may not use `{word}`")).collect()
}

/// What a file without input and output names of the world.
fn world_complaints(path: &Path, text: &str) -> Vec<String> {
    let (code, name) = (code(text), path.display());
    let touched = WORLD.iter().filter(|word| code.contains(**word));
    touched.map(|word| format!("{name}: may not touch the world: `{word}`")).collect()
}

fn length_complaint(path: &Path, text: &str) -> Option<String> {
    (text.lines().count() > MAX_LINES).then(|| format!("{}: more than {MAX_LINES} lines", path.display()))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn every_crate_keeps_to_the_table() {
    let listed = std::fs::read_dir(root().join("crates")).unwrap();
    let listed = listed.map(|entry| format!("crates/{}", entry.unwrap().file_name().to_str().unwrap()));
    let folders: Vec<String> = listed.chain(["protocol", "xtask", "."].map(str::to_owned)).collect();
    let complaints: Vec<String> = folders
        .iter()
        .filter(|folder| root().join(folder).join("Cargo.toml").exists())
        .flat_map(|folder| crate_complaints(folder, &read(&root().join(folder).join("Cargo.toml"))))
        .collect();
    assert!(folders.len() >= CRATES.len(), "{folders:?}");
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn every_module_keeps_to_the_table() {
    let mut complaints = Vec::new();
    let folders: BTreeSet<&str> = FORBIDDEN.iter().map(|(folder, ..)| *folder).collect();
    for folder in folders {
        let root = root().join(folder);
        for path in sources(&root) {
            complaints.extend(module_complaints(folder, path.strip_prefix(&root).unwrap(), &read(&path)));
        }
        let modules = FORBIDDEN.iter().filter(|(listed, ..)| *listed == folder).flat_map(|(_, modules, _)| *modules);
        for module in modules.filter(|module| **module != "*") {
            let is_there = root.join(module).is_dir() || root.join(module).with_extension("rs").is_file();
            assert!(is_there, "{folder} has no module {module}");
        }
    }
    for path in SANS_IO.iter().flat_map(|folder| sources(&root().join(folder))) {
        complaints.extend(world_complaints(&path, &read(&path)));
    }
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn no_file_is_too_long() {
    let folders = ["src", "crates", "protocol", "xtask", "tests", "benches", "examples", "fuzz", "fleet"];
    let folders = folders.iter().map(|folder| root().join(folder)).filter(|folder| folder.exists());
    let files: Vec<PathBuf> = folders.flat_map(|folder| sources(&folder)).collect();
    let is_ours = |path: &&PathBuf| !path.strip_prefix(root()).unwrap().iter().any(|part| part == "target");
    let complaints: Vec<String> =
        files.iter().filter(is_ours).filter_map(|path| length_complaint(path, &read(path))).collect();
    assert!(files.len() > 300, "the sources were not found");
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn a_breach_is_noticed() {
    let manifest = |names: &[&str]| {
        let lines = names.iter().map(|name| format!("{name}.workspace = true\n")).collect::<Vec<_>>().join("");
        format!("[dependencies]\nlibm = \"0.2\"\n{lines}\n[dev-dependencies]\nslamd-testkit.workspace = true\n")
    };
    let complaints = |folder: &str, names: &[&str]| crate_complaints(folder, &manifest(names)).len();
    assert_eq!(complaints("crates/core", &["slamd-protocol"]), 0);
    assert_eq!(complaints("crates/core", &["slamd-protocol", "slamd-capture"]), 1);
    assert_eq!(complaints("crates/capture", &["slamd-core", "slamd-files", "slamd-protocol"]), 1);
    assert_eq!(complaints("crates/capture", &["slamd-core"]), 1, "the table lists more");
    assert_eq!(complaints("crates/metrics", &["slamd-core", "slamd"]), 1);
    assert!(crate_complaints(".", &manifest(&["slamd-testkit"])).iter().any(|said| said.contains("on testkit")));
    assert_eq!(complaints("crates/nowhere", &["slamd-core"]), 1);

    let core = |text: &str| module_complaints("crates/core/src", Path::new("fault/detector.rs"), text).len();
    assert_eq!(core("use crate::position::filter::Filter;\n"), 1);
    assert_eq!(core("use crate::{sweep::Sweep, mapping::grid::OccupancyGrid};\n"), 1);
    assert_eq!(core("use slamd_protocol::Message;\n"), 1);
    assert_eq!(core("use crate::sweep::Sweep; // crate::position\n"), 0);
    let sim = Path::new("robot.rs");
    assert_eq!(module_complaints("crates/sim/src", sim, "use slamd_core::stages::sight;\n").len(), 1);
    assert!(module_complaints("crates/sim/src", sim, "use slamd_core::Pose2;\n").is_empty());

    let path = Path::new("crates/core/src/pipeline.rs");
    assert_eq!(world_complaints(path, "let now = std::time::Instant::now();\n").len(), 1);
    assert!(length_complaint(path, &"\n".repeat(MAX_LINES)).is_none());
    assert!(length_complaint(path, &"\n".repeat(MAX_LINES + 1)).is_some());
}
