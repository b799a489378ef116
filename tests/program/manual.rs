//! What a package installs beside the program: completions that shells read, manual pages without a complaint of groff, and a JSON Schema that
//! refuses what slamd refuses.
//!
//! The schema's test makes a Python environment in Cargo's target folder: it needs `python3` with `venv`, and PyPI the first time.

#![cfg(feature = "manual")]
#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{
    Config,
    config::{Shape, schema, values},
};
use slamd_testkit::python;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn slamd(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_slamd")).args(arguments).output().unwrap()
}

/// Gives a program a text; none where there is no such program.
fn give(mut command: Command, text: &[u8]) -> Option<Output> {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .inspect_err(|error| {
            println!("not tested: {:?} cannot be run ({error})", command.get_program());
        })
        .ok()?;
    let mut stdin = child.stdin.take().unwrap();
    let text = text.to_vec();
    let writer = std::thread::spawn(move || stdin.write_all(&text));
    let output = child.wait_with_output().unwrap();
    let _ = writer.join();
    Some(output)
}

/// The commands that the help lists.
fn commands() -> Vec<String> {
    let help = String::from_utf8(slamd(&["--help"]).stdout).unwrap();
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.map(|line| line.split_whitespace().next().unwrap().to_owned()).filter(|name| name != "help").collect()
}

#[test]
fn every_shell_gets_all_commands() {
    let commands = commands();
    assert!(commands.len() > 10 && commands.contains(&"config".to_owned()), "{commands:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = slamd(&["completions", shell]);
        assert!(output.status.success());
        let script = String::from_utf8_lossy(&output.stdout).into_owned();
        let words = commands.iter().map(String::as_str).chain(["save-calibration", "log-format"]);
        words.for_each(|word| assert!(script.contains(word), "{shell}: {word} is missing"));
        if ["bash", "zsh", "fish"].contains(&shell) {
            let mut check = Command::new(shell);
            check.arg("-n");
            if let Some(checked) = give(check, &output.stdout) {
                assert!(checked.status.success(), "{shell}: {}", String::from_utf8_lossy(&checked.stderr));
            }
        }
    }
    assert_eq!(slamd(&["completions", "dos"]).status.code(), Some(64));
}

/// What groff has to say against a page.
fn complaints(page: &[u8]) -> Option<String> {
    let mut groff = Command::new("groff");
    groff.args(["-k", "-man", "-Tutf8", "-ww", "-z"]);
    Some(String::from_utf8(give(groff, page)?.stderr).unwrap())
}

#[test]
fn every_command_has_a_page_that_groff_renders() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("man/man1");
    assert!(slamd(&["man", "--out", out.to_str().unwrap()]).status.success());
    let written = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let written: Vec<String> = written.collect();
    let pages = commands().into_iter().map(|name| format!("slamd-{name}.1"));
    let nested = ["slamd.1", "slamd-config-show.1", "slamd-bench-accuracy.1"].map(String::from);
    pages.chain(nested).for_each(|name| assert!(written.contains(&name), "{name} is missing in {written:?}"));
    for name in written {
        let page = std::fs::read(out.join(&name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let text = String::from_utf8(page.clone()).unwrap();
        ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS"]
            .iter()
            .for_each(|section| assert!(text.contains(&format!(".SH {section}\n")), "{name}: {section} is missing"));
        assert_eq!(complaints(&page).unwrap_or_default(), "", "{name}");
        // The examples stand as the help has them, line by line.
        let command = name.strip_suffix(".1").unwrap().replace('-', " ");
        let words = command.split(' ').skip(1).chain(["--help"]).collect::<Vec<_>>();
        let help = String::from_utf8(slamd(&words).stdout).unwrap();
        let help = help.split("\nExamples:\n").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap();
        let examples = text.split(".SH EXAMPLES\n.nf\n").nth(1).and_then(|rest| rest.split("\n.fi\n").next());
        let examples = examples.unwrap_or_else(|| panic!("{name}: no examples: {text}"));
        let plain = examples.replace("\\-", "-").replace("\\*(Aq", "'").replace("\\\\", "\\");
        assert_eq!(plain, help.trim_end(), "{name}");
    }
    let run = std::fs::read_to_string(out.join("slamd-run.1")).unwrap();
    assert!(run.contains("SLAMD_PORT") && run.contains("drive.mcap"), "{run}");
    assert_ne!(
        complaints(b".TH x 1\n.nonsense\n").unwrap_or_else(|| "no groff".into()),
        "",
        "groff complains of nothing"
    );
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    assert_eq!(slamd(&["man", "--out", file.join("man").to_str().unwrap()]).status.code(), Some(73));
    // Its own pages are written again; what somebody else wrote is kept, and no page is written beside it.
    let again = slamd(&["man", "--out", out.to_str().unwrap()]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("slamd-run.1"), "mine").unwrap();
    assert_eq!(slamd(&["man", "--out", other.to_str().unwrap()]).status.code(), Some(73));
    assert_eq!(std::fs::read_to_string(other.join("slamd-run.1")).unwrap(), "mine");
    assert_eq!(std::fs::read_dir(&other).unwrap().count(), 1);
    assert!(slamd(&["man", "--force", "--out", other.to_str().unwrap()]).status.success());
}

const JSONSCHEMA: &str = "jsonschema==4.25.1";
/// Reads a schema and a list of TOML texts, and says of each whether the schema takes it.
const SCRIPT: &str = r"
import json, sys, tomllib
from jsonschema import Draft202012Validator
given = json.load(sys.stdin)
Draft202012Validator.check_schema(given['schema'])
validator = Draft202012Validator(given['schema'])
print(json.dumps([validator.is_valid(tomllib.loads(text)) for text in given['texts']]))
";

/// Python with an implementation of JSON Schema that is not ours.
fn python() -> PathBuf {
    python::python(env!("CARGO_TARGET_TMPDIR"), "jsonschema", "jsonschema, tomllib", &[JSONSCHEMA])
}

/// The committed configurations.
fn robots() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let paths = paths.filter(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.map(|path| std::fs::read_to_string(path).unwrap()).collect()
}

/// A configuration with this value, and what goes with it.
fn with(path: &str, value: impl std::fmt::Display) -> String {
    let circle = ["count = 8", "radius_m = 0.1", "half_angle_deg = 9"];
    let mut text = format!("{path} = {value}\n");
    if let Some(key) = path.strip_prefix("ring.circle.") {
        let others = circle.iter().filter(|line| line.split(' ').next() != Some(key));
        others.for_each(|line| text += &format!("ring.circle.{line}\n"));
    }
    text
}

/// Texts at both ends of each value's range, and texts just outside.
fn at_the_bounds() -> (Vec<String>, Vec<String>) {
    let (mut good, mut bad) = (Vec::new(), Vec::new());
    for (path, key) in values() {
        let (ends, outside) = match key.shape {
            Shape::Whole(least, most) => {
                ([least.to_string(), most.to_string()], [least - 1, most + 1].map(|n| n.to_string()))
            }
            Shape::Number(least, most) => {
                ([format!("{least:?}"), format!("{most:?}")], [least - 1e-6, most + 1e-6].map(|n| format!("{n:?}")))
            }
            Shape::Flag | Shape::Switch => (["false".into(), "true".into()], ["2".into(), "'yes'".into()]),
            Shape::Choice(names) => ([0, 1].map(|i| format!("'{}'", names[i])), ["'x'".into(), "1".into()]),
            Shape::Text | Shape::Table(_) | Shape::List(..) => {
                (["''".into(), "'x'".into()], ["1".into(), "true".into()])
            }
        };
        if matches!(key.shape, Shape::List(..)) {
            bad.extend(ends.map(|value| with(&path, value)));
            continue;
        }
        bad.extend(outside.map(|value| with(&path, value)));
        // A value that another one bounds reaches its own end only where that one does.
        let ends = ends.into_iter().take(if key.at_most.is_some() { 1 } else { 2 });
        good.extend(ends.map(|value| with(&path, value)));
    }
    (good, bad)
}

const BAD: &[&str] = &[
    "nonsense = 1",
    "[robot]\nwheelbase_m = 0.3",
    "[robto]",
    "robot = 3",
    "[robot]\nwheel_base_m = '0.3'",
    "[ring.circle]\ncount = 8",
    "[ring.circle]\ncount = 8\nradius_m = 0.1\nhalf_angle_deg = 5\n[[ring.sensors]]\nbearing_deg = 0\nhalf_angle_deg = 5",
    "[[ring.sensors]]\nbearing_deg = 0",
    "[[ring.sensors]]\nbearing_deg = 400\nhalf_angle_deg = 5",
    "[[ring.corrections]]\nsensor = 64",
    "[board]\nbaud = 1",
];

#[test]
fn an_independent_validator_agrees_with_the_check() {
    let (mut good, mut bad) = at_the_bounds();
    good.extend(robots());
    good.push(String::new());
    bad.extend(BAD.iter().map(|text| (*text).to_owned()));
    bad.push(format!("ring.sensors = [{}]", "{bearing_deg = 0, half_angle_deg = 5},".repeat(65)));
    println!("{} good and {} bad texts", good.len(), bad.len());
    assert!(good.len() > 50 && bad.len() > 50);
    for text in &good {
        assert!(Config::from_toml(text).is_ok(), "{text}{:?}", Config::from_toml(text));
    }
    bad.iter().for_each(|text| assert!(Config::from_toml(text).is_err(), "{text}"));

    let printed: serde_json::Value = serde_json::from_slice(&slamd(&["config", "schema"]).stdout).unwrap();
    assert_eq!(printed, serde_json::to_value(schema()).unwrap());
    let texts: Vec<&String> = good.iter().chain(&bad).collect();
    let given = serde_json::json!({ "schema": printed, "texts": texts });
    let mut validate = Command::new(python());
    validate.args(["-c", SCRIPT]);
    let output = give(validate, given.to_string().as_bytes()).expect("python");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let taken: Vec<bool> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(taken.len(), texts.len());
    for (i, (text, is_taken)) in texts.iter().zip(taken).enumerate() {
        assert_eq!(is_taken, i < good.len(), "the schema and slamd do not agree on:\n{text}");
    }
}

#[test]
fn every_key_of_the_schema_is_described() {
    fn look(schema: &serde_json::Value, path: &str, found: &mut usize) {
        let properties = schema["properties"].as_object().or_else(|| schema["items"]["properties"].as_object());
        for (name, key) in properties.into_iter().flatten() {
            assert!(key["description"].as_str().is_some_and(|words| words.ends_with('.')), "{path}.{name}");
            *found += 1;
            look(key, &format!("{path}.{name}"), found);
        }
    }
    let mut found = 0;
    let schema = serde_json::to_value(schema()).unwrap();
    look(&schema, "", &mut found);
    assert!(found > 35, "{found} keys");
    assert_eq!(schema["properties"]["robot"]["properties"]["wheel_base_m"]["default"], 0.26);
}
