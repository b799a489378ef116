//! The committed configurations: the default file is the default, and every robot's file can be read.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::config::Config;
use std::path::Path;

#[test]
fn the_default_file_is_the_default() {
    assert_eq!(Config::from_toml(include_str!("../configs/default.toml")), Ok(Config::default()));
}

#[test]
fn every_robot_can_be_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut read = 0;
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.extension().is_some_and(|extension| extension == "toml") {
            let text = std::fs::read_to_string(&path).unwrap();
            Config::from_toml(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            read += 1;
        }
    }
    assert!(read > 0);
}

#[test]
fn every_key_is_described() {
    let readme = include_str!("../configs/README.md");
    let text = Config::default().to_toml();
    for key in text.lines().filter_map(|line| line.split_once(" = ")).map(|(key, _)| key) {
        assert!(readme.contains(&format!(".{key}`")) || readme.contains(&format!("`{key}`")), "{key} is not described");
    }
}
