//! Where the real program takes its configuration from: files, variables, the command line; what it says of each, and what a replay leaves alone.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::Config;
use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// A separate home folder, without the environment of the user who runs the test.
struct Home {
    folder: tempfile::TempDir,
}

impl Home {
    fn new(files: &[(&str, &str)]) -> Self {
        let home = Self { folder: tempfile::tempdir().unwrap() };
        for (name, text) in files {
            let path = home.path(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        home
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.args(arguments).current_dir(self.folder.path()).env("XDG_CONFIG_HOME", self.folder.path());
        std::env::vars().filter(|(name, _)| name.starts_with("SLAMD_")).for_each(|(name, _)| {
            command.env_remove(name);
        });
        command.envs(variables.iter().copied());
        command
    }

    /// Exit code, standard output, standard error.
    fn slamd(&self, arguments: &[&str], variables: &[(&str, &str)]) -> (i32, String, String) {
        let output = self.command(arguments, variables).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    }
}

const LAYERS: &[(&str, &str)] = &[
    ("slamd/slamd.toml", "[robot]\nname = \"a\"\nwheel_radius_m = 0.04\nwheel_base_m = 0.3\nwheel_ratio = 1.01\n"),
    ("slamd/config.d/10-wheels.toml", "[robot]\nwheel_base_m = 0.31\nwheel_ratio = 1.02\n"),
    ("slamd/config.d/20-more.toml", "robot.wheel_ratio = 1.03\n"),
    ("slamd/config.d/30-not-this.txt", "robot.wheel_ratio = 1.04\n"),
    ("other.toml", "map.cell_m = 0.1\n"),
];

#[test]
fn each_layer_goes_over_the_one_before_and_tells_where_it_is() {
    let home = Home::new(LAYERS);
    let variables = [("SLAMD_ROBOT__MAX_SPEED_M_S", "0.5"), ("SLAMD_METHOD", "walls")];
    let (code, text, log) = home.slamd(&["config", "show", "--method", "paper"], &variables);
    assert_eq!(code, 0, "{log}");
    let place = |name: &str| home.path(name).display().to_string();
    for (line, origin) in [
        ("method = \"paper\"", "--method"),
        ("name = \"a\"", &format!("{}:2", place("slamd/slamd.toml"))),
        ("wheel_radius_m = 0.04", &format!("{}:3", place("slamd/slamd.toml"))),
        ("wheel_base_m = 0.31", &format!("{}:2", place("slamd/config.d/10-wheels.toml"))),
        ("wheel_ratio = 1.03", &format!("{}:1", place("slamd/config.d/20-more.toml"))),
        ("max_speed_m_s = 0.5", "SLAMD_ROBOT__MAX_SPEED_M_S"),
    ] {
        assert!(text.contains(&format!("{line}  # {origin}\n")), "{line} of {origin} is not in\n{text}");
    }
    assert!(text.contains("\ncell_m = 0.05"), "{text}");
    assert!(Config::from_toml(&text).is_ok(), "{text}");
    // A named file replaces the default file and the files beside it.
    let (_, text, _) = home.slamd(&["config", "show", "--config", "other.toml"], &[]);
    assert!(text.contains("cell_m = 0.1  # other.toml:1") && text.contains("wheel_ratio = 1.0\n"), "{text}");
}

#[test]
fn every_error_names_its_place_and_what_would_be_right() {
    let home = Home::new(&[
        ("slamd/slamd.toml", "[robot]\nwheel_base_m = 7\nwheel_raduis_m = 0.04\n"),
        ("good.toml", ""),
        ("bad.toml", "map.cell_m = 0.9"),
    ]);
    let here = home.path("slamd/slamd.toml").display().to_string();
    let (code, _, log) = home.slamd(&["config", "check"], &[("SLAMD_MAP__CELL_M", "wide")]);
    assert_eq!(code, 78, "{log}");
    for words in [
        format!("{here}:2: robot.wheel_base_m = 7 is out of range: it must be from 0.02 to 3\n"),
        format!("{here}:3: unknown key robot.wheel_raduis_m; did you mean robot.wheel_radius_m?\n"),
        "SLAMD_MAP__CELL_M: map.cell_m = wide does not fit: it must be a number from 0.01 to 0.5\n".into(),
    ] {
        assert!(log.contains(&words), "{words} is not in\n{log}");
    }
    let (code, text, log) = home.slamd(&["config", "check", "good.toml", "bad.toml", "nowhere.toml"], &[]);
    assert_eq!((code, text.as_str()), (78, "good.toml: ok, every value is the default\n"), "{log}");
    assert!(
        log.contains("bad.toml:1: map.cell_m = 0.9") && log.contains("nowhere.toml: there is no such file"),
        "{log}"
    );
    assert_eq!(
        home.slamd(&["config", "check", "good.toml"], &[]),
        (0, "good.toml: ok, every value is the default\n".into(), String::new())
    );
    assert_eq!(home.slamd(&["config", "check", "nowhere.toml"], &[]).0, 66);
}

#[test]
fn a_slip_in_a_variable_is_not_obeyed_in_silence() {
    let home = Home::new(&[("slamd/slamd.toml", "")]);
    for (arguments, variable, meant, code) in [
        (&["config", "show"][..], "SLAMD_ROBOT__WHEELBASE_M", "SLAMD_ROBOT__WHEEL_BASE_M", 78),
        (&["run", "--port", "nowhere", "--duration", "0.1"], "SLAMD_LISTN", "SLAMD_LISTEN", 78),
        // Its port is missing because of it.
        (&["run", "--duration", "0.1"], "SLAMD_PROT", "SLAMD_PORT", 64),
    ] {
        let (found, _, log) = home.slamd(arguments, &[(variable, "x")]);
        assert_eq!(found, code, "{log}");
        assert!(log.contains(&format!("{variable}: there is no such variable; did you mean {meant}?")), "{log}");
    }
}

/// What a run has left of its configuration.
fn left(out: &Path) -> Config {
    Config::from_toml(&std::fs::read_to_string(out.join("config.toml")).unwrap()).unwrap()
}

#[test]
fn a_service_needs_no_argument() {
    let home = Home::new(&[("slamd/slamd.toml", "robot.name = \"butler\"\n")]);
    let _robot = Plugged::new(&home.path("board"), Device::new(Board::robot(1), 1));
    let variables = [("SLAMD_PORT", "board"), ("SLAMD_OUT", "kept"), ("SLAMD_MAP__CELL_M", "0.1")];
    let mut command = home.command(&["run", "--method", "paper"], &variables);
    if cfg!(feature = "viewer") {
        command.env("SLAMD_VIEWER", "off");
    }
    let mut daemon = Daemon::run(command);
    daemon.expect("slamd.toml, SLAMD_MAP__CELL_M", Duration::from_secs(5));
    daemon.expect("link: streaming", Duration::from_secs(20));
    daemon.end();
    let config = left(&home.path("kept"));
    assert_eq!((config.robot.name.as_str(), config.method), ("butler", slamd_core::Method::Paper));
    assert!((config.map.cell_m - 0.1).abs() < 1e-9, "{config:?}");
}

#[test]
fn the_command_line_goes_before_a_variable() {
    let home = Home::new(&[]);
    let (code, _, log) = home.slamd(
        &["--port", "typed", "--duration", "0.1"],
        &[("SLAMD_PORT", "variable"), ("SLAMD_LISTEN", "127.0.0.1:0")],
    );
    assert_eq!(code, 75, "{log}");
    assert!(log.contains("there is no typed") && log.contains("api: listening at 127.0.0.1:"), "{log}");
    // The other commands do not hear of a service's options.
    let (code, _, log) = home.slamd(&["monitor", "--capture", "x"], &[("SLAMD_LISTEN", "127.0.0.1:0")]);
    assert!(code == 64 && log.contains("no terminal"), "{log}");
}

#[test]
fn a_replay_is_the_same_whatever_the_machine_s_configuration_is() {
    let home = Home::new(&[
        ("slamd/slamd.toml", "map.cell_m = 9\n"),
        ("one.toml", "map.cell_m = 0.2"),
        ("config.d/x.toml", "map.cell_m = 9"),
    ]);
    let capture = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-emulated-mega.mcap");
    let replay = |options: &[&str]| {
        let arguments = [&["replay", capture.to_str().unwrap(), "--out", "out"], options].concat();
        let variables = [("SLAMD_MAP__CELL_M", "0.3"), ("SLAMD_NONSENSE", "1")];
        let (code, _, log) = home.slamd(&arguments, &variables);
        assert_eq!(code, 0, "{log}");
        left(&home.path("out")).map.cell_m
    };
    assert!((replay(&[]) - 0.05).abs() < 1e-9);
    assert!((replay(&["--config", "one.toml"]) - 0.2).abs() < 1e-9);
}
