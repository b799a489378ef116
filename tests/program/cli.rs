//! Exit codes and words of the command line.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::process::Command;

/// Exit code and standard error.
fn slamd(arguments: &[&str]) -> (i32, String) {
    slamd_logging(arguments, None)
}

/// The same with a `RUST_LOG`.
fn slamd_logging(arguments: &[&str], level: Option<&str>) -> (i32, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("garbage.mcap"), "this is no capture").unwrap();
    std::fs::write(folder.path().join("bad.toml"), "[robot]\nwheel_base_m = 99\n").unwrap();
    std::fs::write(folder.path().join("good.toml"), "[robot]\nwheel_base_m = 0.3\n").unwrap();
    if arguments.contains(&"still.mcap") {
        let mut simulate = Command::new(env!("CARGO_BIN_EXE_slamd"));
        simulate.args(["simulate", "--duration", "0.5", "--capture", "still.mcap"]).current_dir(folder.path());
        assert!(simulate.output().unwrap().status.success());
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.args(arguments).current_dir(folder.path()).env("XDG_CONFIG_HOME", folder.path()).env_remove("RUST_LOG");
    if let Some(level) = level {
        command.env("RUST_LOG", level);
    }
    let output = command.output().unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

/// The examples of the table of exit codes, as numbers and command lines.
fn exit_codes() -> Vec<(i32, Vec<&'static str>)> {
    let rows = include_str!("../../docs/cli.md").lines().filter_map(|line| line.strip_prefix("| "));
    rows.filter_map(|row| {
        let cells: Vec<&str> = row.trim_end_matches(" |").split(" | ").collect();
        let line = cells.last()?.strip_prefix("`slamd ")?.strip_suffix('`')?;
        Some((cells.first()?.parse().ok()?, line.split(' ').collect()))
    })
    .collect()
}

#[test]
fn the_table_of_exit_codes_is_true() {
    let codes = exit_codes();
    assert_eq!(codes.iter().map(|(code, _)| *code).collect::<Vec<_>>(), [0, 64, 65, 66, 69, 73, 74, 75, 78]);
    for (code, line) in codes {
        let (found, text) = slamd(&line);
        assert_eq!(found, code, "slamd {}: {text}", line.join(" "));
        assert_eq!(text.is_empty(), code == 0, "slamd {}: {text}", line.join(" "));
    }
}

/// Each line of the log as an object with time, level and message.
fn objects(text: &str) -> Vec<serde_json::Value> {
    let object = |line: &str| serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"));
    let lines: Vec<serde_json::Value> = text.lines().map(object).collect();
    for line in &lines {
        assert!(line["timestamp"].as_str().is_some_and(|time| time.starts_with("20") && time.ends_with('Z')), "{line}");
        assert!(line["level"].is_string() && line["message"].is_string() && line["target"].is_string(), "{line}");
    }
    lines
}

#[test]
fn each_line_of_a_json_log_is_an_object() {
    let arguments = ["--log-format", "json", "--port", "nowhere", "--config", "good.toml", "--duration", "0.3"];
    let (code, text) = slamd_logging(&arguments, Some("debug"));
    assert_eq!(code, 75, "{text}");
    let lines = objects(&text);
    let said = |words: &str| lines.iter().any(|line| line["message"].as_str().unwrap().contains(words));
    assert!(said("configuration: good.toml") && said("link: searching"), "{text}");
    // The last words of a failure come whatever else is silenced.
    for level in [None, Some("off"), Some("trace")] {
        let (code, text) = slamd_logging(&["--port", "x", "--config", "bad.toml", "--log-format=json"], level);
        let lines = objects(&text);
        let last = lines.last().unwrap();
        assert!(code == 78 && last["exit_code"] == 78 && last["level"] == "ERROR", "{text}");
        assert!(last["message"].as_str().unwrap().starts_with("bad.toml:2: robot.wheel_base_m = 99"), "{text}");
    }
    let (_, text) = slamd_logging(&["--port", "x", "--duration", "0.1"], Some("off"));
    // The last words alone.
    assert!(text.starts_with("slamd: nothing mapped: ") && text.lines().count() == 1, "RUST_LOG is not obeyed: {text}");
    let (_, text) = slamd_logging(&["--port", "x", "--duration", "0.1"], None);
    assert!(text.contains(" WARN link: searching"), "{text}");
}

#[test]
fn verbose_and_quiet_choose_what_is_logged() {
    let log = |level: &str| slamd(&[level, "--port", "nowhere", "--config", "good.toml", "--duration", "0.2"]).1;
    assert!(log("-q").contains("WARN") && !log("-q").contains("INFO"), "{}", log("-q"));
    assert!(log("-v").contains("INFO"), "{}", log("-v"));
    let (_, text) =
        slamd_logging(&["-v", "--port", "nowhere", "--config", "good.toml", "--duration", "0.2"], Some("off"));
    assert!(text.contains("INFO"), "-v does not override RUST_LOG: {text}");
}

#[test]
fn errors_of_the_system_are_in_words() {
    for (arguments, words) in [
        (&["inspect", "."][..], "it is a folder, not a file"),
        (&["simulate", "--duration", "1", "--capture", "good.toml/x.mcap"], "it is a file, not a folder"),
        (&["replay", "still.mcap", "-o", "good.toml"], "good.toml is a file, not a folder"),
        (&["replay", "nowhere.mcap"], "there is no such file or folder"),
    ] {
        let (_, text) = slamd(arguments);
        assert!(text.contains(words) && !text.contains("os error"), "{arguments:?}: {text}");
    }
}

#[cfg(not(feature = "viewer"))]
#[test]
fn a_build_without_viewer_takes_viewer_off() {
    let (code, text) = slamd(&["replay", "nowhere.mcap", "--viewer", "off"]);
    assert!(code == 66, "{text}");
    let (code, text) = slamd(&["replay", "nowhere.mcap", "--viewer", "spawn"]);
    assert!(code == 64 && text.contains("this build of slamd has no viewer"), "{text}");
}

#[test]
fn a_missing_capture_is_no_input() {
    let (code, text) = slamd(&["replay", "nowhere.mcap"]);
    assert_eq!(code, 66, "{text}");
    assert!(text.contains("nowhere.mcap"), "{text}");
}

#[test]
fn garbage_is_bad_data() {
    let (code, text) = slamd(&["replay", "garbage.mcap"]);
    assert_eq!(code, 65, "{text}");
}

#[test]
fn a_bad_configuration_names_line_key_and_range() {
    let (code, text) = slamd(&["--port", "nowhere", "--config", "bad.toml"]);
    assert_eq!(code, 78, "{text}");
    assert!(text.contains("bad.toml:2: robot.wheel_base_m = 99") && text.contains("from 0.02 to 3"), "{text}");
}

#[test]
fn an_unknown_world_lists_the_known_ones() {
    let (code, text) = slamd(&["simulate", "--world", "moon", "--capture", "x.mcap"]);
    assert_eq!(code, 64, "{text}");
    assert!(text.contains("flat, office, furnished"), "{text}");
}

#[test]
fn a_missing_port_says_what_to_do() {
    let (code, text) = slamd(&["--port", "/dev/nowhere", "--exit-on-hangup"]);
    assert_eq!(code, 69, "{text}");
    assert!(text.contains("plug the board in"), "{text}");
}

#[test]
fn a_missing_port_is_waited_for() {
    let (code, text) = slamd(&["--port", "/dev/nowhere", "--duration", "0.3"]);
    assert_eq!(code, 75, "{text}");
    assert!(text.contains("the session was over before the port /dev/nowhere was found; plug the board in"), "{text}");
    assert!(text.contains("link: searching (port missing: there is no /dev/nowhere; plug the board in"), "{text}");
}

#[test]
fn a_session_starts_once_and_a_damaged_file_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("home.session");
    let capture = concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-emulated-mega.mcap");
    let out = folder.path().join("out");
    let again = || {
        let (out, session) = (out.to_str().unwrap(), session.to_str().unwrap());
        slamd(&["replay", capture, "--out", out, "--session", session])
    };
    let (code, text) = again();
    assert!(code == 0 && text.contains("no session file yet") && session.exists(), "{code}: {text}");
    let (code, text) = again();
    assert!(code == 0 && !text.contains("no session file yet"), "{code}: {text}");
    std::fs::write(&session, "this is no session").unwrap();
    let (code, text) = again();
    assert_eq!(code, 65, "{text}");
    assert_eq!(std::fs::read_to_string(&session).unwrap(), "this is no session");
    assert_eq!(slamd(&["replay", capture, "--session", "x", "--resume", "x"]).0, 64);
}

#[test]
fn ports_are_listed_for_programs() {
    let output = Command::new(env!("CARGO_BIN_EXE_slamd")).args(["ports", "--json"]).output().unwrap();
    let ports: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for port in ports.as_array().unwrap() {
        assert!(port["path"].as_str().unwrap().starts_with("/dev/"), "{port}");
        assert!(port["holders"].is_array() && port["name"].is_string(), "{port}");
    }
    assert_eq!(slamd(&["ports"]).0, 0);
}

#[test]
fn a_monitor_without_a_terminal_says_what_to_use_instead() {
    let (code, text) = slamd(&["monitor", "--capture", "nowhere.mcap"]);
    assert_eq!(code, 64, "{text}");
    assert!(text.contains("no terminal") && text.contains("slamd --port") && text.contains("slamd inspect"), "{text}");
    assert_eq!(slamd(&["monitor"]).0, 64);
    assert_eq!(slamd(&["monitor", "--port", "auto", "--capture", "x.mcap"]).0, 64);
}

#[test]
fn usage_errors_are_usage_errors() {
    assert_eq!(slamd(&["fly"]).0, 64);
    assert_eq!(slamd(&["--help"]).0, 0);
}

/// The help of a command for a terminal of so many columns.
fn help(command: &[&str], columns: u32) -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_slamd"));
    let output = program.args(command).arg("--help").env("COLUMNS", columns.to_string()).output().unwrap();
    assert!(output.status.success(), "{command:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Each command with its subcommands.
fn commands(path: &[&str]) -> Vec<Vec<String>> {
    let mut found = vec![path.iter().map(|word| (*word).to_owned()).collect()];
    let text = help(path, 200);
    let lines = text.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = lines.filter(|line| !line.starts_with("   ")).map(|line| line.split_whitespace().next().unwrap());
    for name in names.filter(|name| *name != "help") {
        found.extend(commands(&[path, &[name]].concat()));
    }
    found
}

#[test]
fn the_examples_of_the_help_fit_80_columns() {
    let examples = |command: &[&str], columns| {
        let text = help(command, columns);
        let (_, examples) = text.split_once("\nExamples:\n").unwrap_or_else(|| panic!("{command:?}: {text}"));
        examples.split("\n\n").next().unwrap().trim_end().to_owned()
    };
    let commands = commands(&[]);
    assert!(commands.len() > 18, "{commands:?}");
    for command in commands {
        let command: Vec<&str> = command.iter().map(String::as_str).collect();
        let narrow = examples(&command, 80);
        narrow.lines().for_each(|line| assert!(line.len() < 78, "{command:?}: {} columns: {line}", line.len()));
        assert_eq!(narrow, examples(&command, 400), "{command:?}: a line is wrapped");
    }
}

#[test]
fn the_help_says_the_defaults() {
    let said = |command: &str, words: &str| {
        let text = help(&[command], 400);
        assert!(text.contains(words), "{command}: {words} is missing in {text}");
    };
    said("run", "The default is the configuration's `method`, or walls");
    said("run", "The default is 60 in a folder (DIR/)");
    said("simulate", "without it, --pty is needed");
    let (code, text) = slamd(&["simulate"]);
    assert!(code == 64 && text.contains("--capture <FILE>|--pty <NAME>"), "{text}");
}

#[test]
fn an_address_is_explained() {
    for option in ["--listen", "--metrics"] {
        for address in ["80", "localhost:80", "127.0.0.1", "127.0.0.1:99999"] {
            let (code, text) = slamd(&["--port", "nowhere", option, address]);
            assert!(code == 64 && text.contains("it must be IP:PORT, for example 127.0.0.1:9878"), "{text}");
        }
    }
}

#[test]
fn what_is_no_port_is_refused_at_once() {
    let capture = concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-emulated-mega.mcap");
    for (port, words) in [
        ("/dev/null", "/dev/null is a device or pipe, no serial port; `slamd ports` lists".to_owned()),
        ("good.toml", "good.toml is a file, no serial port".into()),
        (".", ". is a folder, no serial port".into()),
        (capture, format!("{capture} is a capture, no serial port; replay it with `slamd replay {capture}`")),
    ] {
        // The duration ends a run that waits, with 75.
        let (code, text) = slamd(&["--port", port, "--duration", "5"]);
        assert!(code == 69 && text.contains(&words) && !text.contains("searching"), "{port}: {code}: {text}");
    }
}

#[test]
fn a_folder_is_replayed_and_a_bad_capture_stops_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let captures = folder.path().join("captures");
    std::fs::create_dir(&captures).unwrap();
    let good = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-emulated-mega.mcap");
    std::fs::copy(good, captures.join("good.mcap")).unwrap();
    std::fs::write(captures.join("bad.mcap"), "this is no capture").unwrap();
    let replay = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.arg("replay").arg(&captures).arg("--out").arg(folder.path().join("out")).args(options);
        let output = command.output().unwrap();
        (
            output.status.code().unwrap(),
            String::from_utf8(output.stdout).unwrap(),
            String::from_utf8(output.stderr).unwrap(),
        )
    };
    let (code, table, log) = replay(&["--jobs", "2"]);
    assert_eq!(code, 65, "{log}");
    assert!(log.contains("1 of 2 captures could not be replayed") && log.contains("not an MCAP file"), "{log}");
    assert!(table.contains("| bad | failed |") && table.contains("| good | 60 | 599 | 0 | 0 |"), "{table}");
    assert!(folder.path().join("out/good/map.png").exists());
    let (code, _, log) = replay(&["--save-session", "x"]);
    assert_eq!(code, 64, "{log}");
    assert!(log.contains("need a single capture"), "{log}");
    std::fs::remove_file(captures.join("bad.mcap")).unwrap();
    let (code, json, log) = replay(&["--json"]);
    assert_eq!(code, 0, "{log}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(json[0]["summary"]["map_m2"].as_f64().unwrap() > 20.0, "{json}");
}

/// Replays a capture into `out`: exit code, standard error and `summary.json`.
fn replayed(folder: &std::path::Path, capture: &str) -> (i32, String, serde_json::Value) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    let output = command.args(["replay", capture, "--out", "out"]).current_dir(folder).output().unwrap();
    let summary = serde_json::from_slice(&std::fs::read(folder.join("out/summary.json")).unwrap()).unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap(), summary)
}

#[test]
fn a_capture_without_a_frame_is_bad_data_and_leaves_no_map() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.mcap");
    slamd_capture::CaptureWriter::create(&path, &slamd_capture::CaptureInfo::default()).unwrap().finish().unwrap();
    let (code, log, summary) = replayed(folder.path(), "empty.mcap");
    assert_eq!(code, 65, "{log}");
    assert!(
        log.contains("empty.mcap: nothing mapped") && log.contains("no frames: the board has sent nothing"),
        "{log}"
    );
    assert!(summary["nothing_mapped"].as_str().unwrap().starts_with("no frames"), "{summary}");
    let png = std::fs::read(folder.path().join("out/map.png")).unwrap();
    let picture = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    assert!(picture.info().height < 400, "a sheet of words, not a map");
    assert_eq!(std::fs::read(folder.path().join("out/map.pgm")).unwrap(), b"P5\n1 1\n255\n\xcd");
}

#[test]
fn a_robot_that_stood_still_waited_for_movement() {
    let folder = tempfile::tempdir().unwrap();
    let config = "[robot]\nticks_per_turn = 1440\n[ring.circle]\ncount = 8\nradius_m = 0.1\nhalf_angle_deg = 15\n";
    std::fs::write(folder.path().join("robot.toml"), config).unwrap();
    let columns: Vec<String> = (0..8).map(|sensor| format!("r{sensor}")).collect();
    let rows = (0..300u32).map(|k| format!("{:.1},7,9,1,1.5,2,1.5,1,1.5,2,1.5\n", 0.1 * f64::from(k)));
    let csv = format!("t_s,left_ticks,right_ticks,{}\n{}", columns.join(","), rows.collect::<String>());
    std::fs::write(folder.path().join("still.csv"), csv).unwrap();
    let mut import = Command::new(env!("CARGO_BIN_EXE_slamd"));
    import.args(["import", "ring", "still.csv", "--config", "robot.toml", "--capture", "stood.mcap"]);
    assert!(import.current_dir(folder.path()).output().unwrap().status.success());
    let (code, log, summary) = replayed(folder.path(), "stood.mcap");
    assert_eq!(code, 75, "{log}");
    assert!(log.contains("waiting for movement: the robot has not moved"), "{log}");
    assert!(summary["map_m2"] == 0.0 && summary["sweeps"] == 300, "{summary}");
}

#[test]
fn the_last_line_says_what_came_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let capture = concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-paper-faults.mcap");
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    let output = command.args(["replay", capture, "--out", "out"]).current_dir(folder.path()).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let last = text.lines().last().unwrap();
    assert!(last.starts_with("mapped ") && last.contains(" m of way in ") && last.contains(" ignored; "), "{text}");
    assert!(output.status.success() && last.ends_with("; nothing doubtful"), "{text}");
}
