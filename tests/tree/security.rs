//! Each row of the tables of bounds in `SECURITY.md` names a test that exists.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;

#[test]
fn each_door_names_the_test_of_its_bound() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("SECURITY.md")).unwrap();
    let (_, tables) = page.split_once("\n## Every door and its bound\n").unwrap();
    let (tables, _) = tables.split_once("\n## ").unwrap();
    let rows = tables.lines().filter(|line| line.starts_with("| ") && !line.ends_with("| test |"));
    let mut checked = 0;
    for row in rows {
        let test = row.trim_end_matches(" |").rsplit(" | ").next().unwrap();
        let (file, name) = test.split_once(": ").unwrap_or_else(|| panic!("no test in: {row}"));
        let (file, name) = (file.trim_matches('`'), name.trim_matches('`'));
        let source = std::fs::read_to_string(root.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        let head = source.split(&format!("fn {name}()")).next().filter(|head| head.len() < source.len());
        let attributes = head.and_then(|head| head.rsplit("\n\n").next()).unwrap_or_default();
        assert!(attributes.contains("#[test]"), "{file} has no test {name}");
        checked += 1;
    }
    assert!(checked > 20, "{checked} rows");
}
