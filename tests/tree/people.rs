//! The pages and workflows for people agree with the code.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_protocol::{VERSION_MAJOR, VERSION_MINOR};

const WORKFLOWS: [&str; 2] =
    [include_str!("../../.github/workflows/ci.yml"), include_str!("../../.github/workflows/release.yml")];

#[test]
fn the_changelog_names_the_wire_protocols_version() {
    let changelog = include_str!("../../CHANGELOG.md");
    let unreleased = changelog.split("\n## ").find(|section| section.starts_with("[Unreleased]")).unwrap();
    let row = unreleased.lines().find(|line| line.starts_with("| wire protocol")).unwrap();
    assert!(row.contains(&format!("| {VERSION_MAJOR}.{VERSION_MINOR} |")), "{row}");
}

#[test]
fn the_workflows_use_the_least_rust_that_is_supported() {
    for workflow in WORKFLOWS {
        let images: Vec<_> = workflow.split("rust:").skip(1).filter_map(|rest| rest.split_once('-')).collect();
        assert!(!images.is_empty(), "no image");
        assert!(images.iter().all(|(version, _)| *version == env!("CARGO_PKG_RUST_VERSION")), "{images:?}");
    }
}
