//! What comes into the build, as `deny.toml` has it: licenses that are allowed, no crate that is banned, all from the one registry.
//!
//! `cargo deny check licenses bans sources` reads the same file; this test needs nothing but cargo, which has the list of crates already.

#![allow(clippy::unwrap_used, reason = "a test may")]

use spdx::{Expression, ParseMode};
use std::collections::BTreeSet;
use std::process::Command;

/// The daemon's crates, and those of the program for fleets.
const MANIFESTS: [&str; 2] = ["Cargo.toml", "fleet/Cargo.toml"];

/// What `deny.toml` says.
struct Rules {
    targets: BTreeSet<String>,
    licenses: BTreeSet<String>,
    banned: BTreeSet<String>,
    registries: BTreeSet<String>,
}

/// One crate of the build.
struct Package {
    name: String,
    license: Option<String>,
    /// None for our own.
    source: Option<String>,
}

impl Rules {
    fn read() -> Self {
        let table: toml::Table = include_str!("../../deny.toml").parse().unwrap();
        let text = |value: &toml::Value| value.get("crate").unwrap_or(value).as_str().unwrap().to_owned();
        let list = |part: &str, key: &str| table[part][key].as_array().unwrap().iter().map(text).collect();
        Self {
            targets: list("graph", "targets"),
            licenses: list("licenses", "allow"),
            banned: list("bans", "deny"),
            registries: list("sources", "allow-registry"),
        }
    }

    /// What speaks against a crate; `used` gets the licenses that let it in.
    fn complaints(&self, package: &Package, used: &mut BTreeSet<String>) -> Vec<String> {
        let mut complaints = Vec::new();
        let name = &package.name;
        let license = package.license.as_deref().unwrap_or("none");
        match Expression::parse_mode(license, ParseMode::LAX) {
            Ok(expression) => {
                let is_allowed = expression.evaluate(|requirement| {
                    let is_listed = self.licenses.contains(&requirement.to_string());
                    if is_listed {
                        used.insert(requirement.to_string());
                    }
                    is_listed
                });
                if !is_allowed {
                    complaints.push(format!("{name}: the license {license} is not allowed"));
                }
            }
            Err(_) => complaints.push(format!("{name}: `{license}` is no license")),
        }
        if self.banned.contains(name) {
            complaints.push(format!("{name}: is banned"));
        }
        let is_known = |source: &String| self.registries.iter().any(|url| *source == format!("registry+{url}"));
        if !package.source.as_ref().is_none_or(is_known) {
            complaints.push(format!("{name}: comes from {:?}", package.source));
        }
        complaints
    }
}

/// Every crate of a workspace that is built for one of the targets, for tests and tools too.
fn packages(manifest: &str, targets: &BTreeSet<String>) -> Vec<Package> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--format-version=1", "--locked", "--all-features", "--manifest-path", manifest]);
    cargo.args(targets.iter().flat_map(|target| ["--filter-platform", target]));
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = |package: &serde_json::Value, key: &str| package[key].as_str().map(str::to_owned);
    let packages = metadata["packages"].as_array().unwrap().iter();
    packages
        .map(|package| Package {
            name: text(package, "name").unwrap(),
            license: text(package, "license"),
            source: text(package, "source"),
        })
        .collect()
}

#[test]
fn dependencies_have_allowed_licenses_and_come_from_the_registry() {
    let rules = Rules::read();
    let mut used = BTreeSet::new();
    for manifest in MANIFESTS {
        let packages = packages(manifest, &rules.targets);
        let complaints: Vec<String> =
            packages.iter().flat_map(|package| rules.complaints(package, &mut used)).collect();
        println!("{manifest}: {} crates, {} licenses", packages.len(), used.len());
        assert!(packages.len() > 100, "the crates were not found");
        assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
    }
    assert_eq!(used, rules.licenses, "licenses that nothing needs are not allowed either");
}

#[test]
fn a_breach_is_noticed() {
    let rules = Rules::read();
    let crates_io = rules.registries.first().map(|url| format!("registry+{url}"));
    let complaints = |name: &str, license: Option<&str>, source: Option<String>| {
        let package = Package { name: name.into(), license: license.map(Into::into), source };
        rules.complaints(&package, &mut BTreeSet::new())
    };
    assert_eq!(complaints("a", Some("MIT/Apache-2.0"), crates_io.clone()), [""; 0]);
    assert_eq!(complaints("a", Some("GPL-3.0-only"), crates_io.clone()).len(), 1);
    assert_eq!(complaints("a", Some("MIT AND GPL-3.0-only"), crates_io.clone()).len(), 1);
    assert_eq!(complaints("a", None, crates_io.clone()).len(), 1);
    assert_eq!(complaints("openssl-sys", Some("MIT"), crates_io).len(), 1);
    assert_eq!(complaints("a", Some("MIT"), Some("git+https://example.org/a".into())).len(), 1);
}
