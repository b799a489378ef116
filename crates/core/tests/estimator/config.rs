//! The committed configurations: the default file is the default, and every robot's file can be read.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{
    Config,
    config::{Key, Shape, values},
};
use slamd_protocol::Setting;

#[test]
fn the_default_file_is_the_default() {
    assert_eq!(Config::from_toml(include_str!("../../../../configs/default.toml")), Ok(Config::default()));
}

#[test]
fn every_robot_can_be_read() {
    let folder = slamd_testkit::root().join("configs");
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

/// Keys, each with the words for its range that its row of the README must have.
fn described(path: &str, key: &Key, found: &mut Vec<(String, String)>) {
    let range = |least: &dyn std::fmt::Display, most: &dyn std::fmt::Display| match key.at_most {
        Some(other) => format!("{least} – `{other}`"),
        None => format!("{least} – {most}"),
    };
    match &key.shape {
        Shape::List(keys, _) => keys.iter().for_each(|key| described(&format!("{path}.{}", key.name), key, found)),
        Shape::Whole(least, most) => found.push((path.into(), range(least, most))),
        Shape::Number(least, most) => found.push((path.into(), range(least, most))),
        _ => found.push((path.into(), String::new())),
    }
}

#[test]
fn every_key_is_described_with_its_range() {
    let readme = include_str!("../../../../configs/README.md").replace('−', "-").replace(',', "");
    let mut expected = Vec::new();
    values().iter().for_each(|(path, key)| described(path, key, &mut expected));
    assert!(expected.len() > 30);
    for (path, range) in expected {
        let (section, name) = path.rsplit_once('.').unwrap_or(("", &path));
        // Keys of one kind share a row, which begins with the first one's whole name.
        let has = |row: &str| {
            row.contains(&format!("`{path}`")) || (row.contains(section) && row.contains(&format!("`{name}`")))
        };
        let rows = readme.lines().filter(|line| line.starts_with("| `"));
        assert!(rows.clone().any(|row| has(row) && row.contains(&range)), "{path} {range} is not described");
    }
}

#[test]
fn the_bare_rings_are_rings() {
    for sensors in [8, 16, 24, 32] {
        let path = slamd_testkit::root().join(format!("configs/ring{sensors}.toml"));
        let config = Config::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap();
        let ring = config.ring.ring().unwrap();
        assert_eq!(ring.len(), sensors);
        let second = ring.mountings[1].robot_from_sensor;
        assert!((second.theta_rad.to_degrees() - 360.0 / sensors as f64).abs() < 1e-9 && second.y_m > 0.0);
        // Board and circle say the same, in groups as even as they can be.
        let board = |setting| config.settings().find(|(found, _)| *found == setting).map(|(_, value)| value);
        assert_eq!(board(Setting::Sensors), i32::try_from(sensors).ok());
        let last_group = ring.mountings.iter().map(|mounting| i32::from(mounting.group)).max().unwrap();
        assert_eq!(board(Setting::Groups), Some(last_group + 1));
        // It is the board's own geometry, too.
        let radius_m = ring.mountings[0].robot_from_sensor.x_m;
        assert!((1e3 * radius_m - f64::from(Setting::RingRadiusMm.default())).abs() < 1e-6);
    }
}
