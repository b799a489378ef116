//! The book in docs/book: its pages exist, its table of findings is whole, and its commands run.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// What stands between two marks, everywhere.
fn between<'a>(text: &'a str, open: &'a str, close: &'a str) -> impl Iterator<Item = &'a str> {
    text.split(open).skip(1).filter_map(move |rest| rest.split_once(close).map(|(inner, _)| inner))
}

/// The pages, in the order of the book.
fn pages() -> Vec<PathBuf> {
    let folder = root().join("docs/book/src");
    let summary = text(&folder.join("SUMMARY.md"));
    between(&summary, "](", ")").map(|page| folder.join(page)).collect()
}

#[test]
fn every_page_and_what_it_includes_exists() {
    let pages = pages();
    assert!(pages.len() > 8, "{pages:?}");
    for page in &pages {
        let text = text(page);
        let folder = page.parent().unwrap();
        let includes = between(&text, "{{#include ", "}}").map(|include| include.split(':').next().unwrap());
        let links = between(&text, "](", ")").filter(|link| !link.starts_with("http"));
        for file in includes.chain(links) {
            assert!(folder.join(file).exists(), "{}: there is no {file}", page.display());
        }
    }
    let files = std::fs::read_dir(root().join("docs/book/src")).unwrap().map(|entry| entry.unwrap().path());
    let unlisted = files.filter(|file| file.extension().is_some_and(|it| it == "md") && !file.ends_with("SUMMARY.md"));
    let unlisted: Vec<_> = unlisted.filter(|file| !pages.contains(file)).collect();
    assert!(unlisted.is_empty(), "SUMMARY.md does not name {unlisted:?}");
}

#[test]
fn each_page_has_a_heading_in_its_source() {
    for page in pages() {
        assert!(text(&page).starts_with("# "), "{}: the first line is no heading", page.display());
    }
}

#[test]
fn the_doctors_findings_are_all_explained() {
    let kinds = ["line.", "clock.", "sensor.", "sensors.", "wheels.", "model.", "host."];
    let is_finding = |word: &&str| {
        let is_plain = |byte: u8| byte.is_ascii_lowercase() || byte == b'_' || byte == b'.';
        kinds.iter().any(|kind| word.starts_with(kind) && word.len() > kind.len()) && word.bytes().all(is_plain)
    };
    let mut said = BTreeSet::new();
    for folder in ["src/doctor", "src/cli/doctor"] {
        let files = std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
        for file in files.filter(|path| path.is_file()) {
            let source = text(&file);
            said.extend(source.split('"').filter(is_finding).map(str::to_owned));
        }
    }
    let page = text(&root().join("docs/book/src/trouble.md"));
    // The first cell of each row names the findings that the row explains.
    let names = page.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
    let mut explained: Vec<&str> = names.flat_map(|cell| cell.split('`')).filter(is_finding).collect();
    explained.sort_unstable();
    assert!(said.len() > 30, "{said:?}");
    let said: Vec<&str> = said.iter().map(String::as_str).collect();
    assert_eq!(said, explained, "docs/book/src/trouble.md explains the findings of `slamd doctor`, each once");
}

/// The longest that a command of the book may drive here, seconds.
const LONGEST_S: u32 = 15;

/// The commands in a page's blocks of shell, with long drives cut short.
fn blocks(page: &str) -> Vec<String> {
    let shorter = |word: &str| match word.parse::<u32>() {
        Ok(seconds) => seconds.min(LONGEST_S).to_string(),
        Err(_) => word.to_owned(),
    };
    let line = |line: &str| {
        let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
        for place in 1..words.len() {
            if words[place - 1] == "--duration" {
                words[place] = shorter(&words[place]);
            }
        }
        words.join(" ")
    };
    between(page, "```sh\n", "```").map(|block| block.lines().map(line).collect::<Vec<_>>().join("\n")).collect()
}

#[test]
fn the_commands_run() {
    let program = Path::new(env!("CARGO_BIN_EXE_slamd"));
    let path = format!("{}:{}", program.parent().unwrap().display(), std::env::var("PATH").unwrap());
    let mut ran = 0;
    for page in pages() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["replay", "configs"] {
            std::os::unix::fs::symlink(root().join(name), folder.path().join(name)).unwrap();
        }
        for block in blocks(&text(&page)) {
            // What a block leaves in the background must not outlive it; what it waits for must come.
            let script = format!("set -euo pipefail\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{block}\n");
            let mut command = Command::new("timeout");
            command.args(["120", "bash", "-c", &script]).current_dir(folder.path());
            command.env("PATH", &path).env("XDG_RUNTIME_DIR", folder.path()).env_remove("DISPLAY");
            let output = command.output().unwrap();
            let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            assert!(output.status.success(), "{}\n{block}\n{}\n{out}\n{err}", page.display(), output.status);
            ran += 1;
        }
        if page.ends_with("first-map.md") {
            let map = std::fs::metadata(folder.path().join("slamd-out/map.png")).unwrap();
            assert!(map.len() > 5_000, "the first map is a picture");
        }
    }
    assert!(ran >= 5, "{ran} blocks");
}
