//! A Python environment with packages of PyPI, made in Cargo's target folder. It needs `python3` with `venv`, and PyPI the first time.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Its interpreter; the environment is rebuilt if it cannot import `modules`.
pub fn python(target: &str, name: &str, modules: &str, packages: &[&str]) -> PathBuf {
    let folder = Path::new(target).join(name);
    let python = folder.join("bin/python");
    // Some packages keep settings in the home folder.
    let is_there = Command::new(&python).args(["-c", &format!("import {modules}")]).env("HOME", &folder).output();
    if !is_there.is_ok_and(|output| output.status.success()) {
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder), "is python3-venv installed?");
        let mut install = Command::new(&python);
        install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(packages);
        run(&mut install, "is PyPI in reach?");
    }
    python
}

/// What a program prints; it must succeed.
pub fn run(command: &mut Command, hint: &str) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}; {hint}"));
    assert!(output.status.success(), "{command:?}: {}; {hint}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}
