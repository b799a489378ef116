//! Two outputs of one command never have the same name, and a simulated drive replaces only itself.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::process::Command;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");

/// The exit code and what the command says on standard error.
fn slamd(folder: &Path, line: &str) -> (i32, String) {
    let mut command = Command::new(SLAMD);
    command.args(line.split(' ')).current_dir(folder).env("XDG_CONFIG_HOME", "/nonexistent");
    let output = command.output().unwrap();
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The command is refused, and writes nothing.
fn refuses(folder: &Path, line: &str) {
    let names = || {
        let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let (code, error) = slamd(folder, line);
    assert_eq!(code, 64, "{line}: {error}");
    assert!(error.contains("two outputs have this name"), "{line}: {error}");
    assert_eq!(names(), before, "{line}");
}

#[test]
fn a_session_does_not_replace_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let run = "--port nowhere --duration 0.1 --out o --record same.mcap";
    for option in [
        "--save-session same.mcap",
        "--session ./same.mcap",
        "--save-calibration same.mcap",
        // The names of its further parts.
        "--save-session same-0002.mcap",
        "--session ./same-0017.mcap",
    ] {
        refuses(folder.path(), &format!("{run} {option}"));
    }
    std::fs::create_dir(folder.path().join("drives")).unwrap();
    let into =
        "--port nowhere --duration 0.1 --out o --record drives/ --save-session drives/slamd-1700000000-0002.mcap";
    refuses(folder.path(), into);
    // Allowed; but there is no port.
    let (code, error) = slamd(folder.path(), &format!("{run} --save-session other.session"));
    assert_eq!(code, 75, "{error}");
}

#[test]
fn no_output_has_the_name_of_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    assert_eq!(slamd(here, "simulate --duration 5 --capture drive.mcap").0, 0);
    let absolute = here.canonicalize().unwrap().join("o/map.yaml");
    let absolute = absolute.to_str().unwrap();
    for forced in ["", " --force"] {
        for option in [
            "--save-session o/summary.json",
            "--session ./o/map.png",
            "--save-session o/trajectory.tum",
            &format!("--save-calibration {absolute}"),
        ] {
            refuses(here, &format!("replay drive.mcap --out o{forced} {option}"));
            refuses(here, &format!("run --port nowhere --duration 0.1 --out ./o{forced} {option}"));
        }
        refuses(here, &format!("run --port nowhere --duration 0.1 --out o{forced} --record o/map.png"));
        refuses(here, &format!("run --port nowhere --duration 0.1{forced} --record slamd-out/config.toml"));
    }
    let (code, error) = slamd(here, "replay drive.mcap --out o --save-session o/home.session");
    assert!(code == 0 || code == 75, "{code}: {error}");
    // The folder exists now, and so do its files.
    for name in ["summary.json", "truth.tum", "map.png"] {
        let before = std::fs::read(here.join("o").join(name)).ok();
        refuses(here, &format!("replay drive.mcap --out o --force --save-session o/{name}"));
        assert_eq!(std::fs::read(here.join("o").join(name)).ok(), before);
    }
}

#[test]
fn a_simulated_drive_replaces_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let drive = "simulate --duration 1 --capture drive.mcap";
    assert_eq!(slamd(here, drive).0, 0);
    let made = std::fs::read(here.join("drive.mcap")).unwrap();
    assert_eq!(slamd(here, drive).0, 0, "the same again");
    assert_eq!(slamd(here, &format!("{drive} --sensors 32 --clock-drift 300 --beam cone")).0, 0, "the defaults");
    for other in [
        "--seed 2",
        "--world room",
        "--sensors 8",
        "--beam point",
        "--fault 3:stuck@0",
        "--encoder-fault left:dead@0",
        "--robot-fault ticks=2",
        "--odometry-errors 0",
        "--clock-drift 0",
        "--bit-errors 0.001",
    ] {
        let (code, error) = slamd(here, &format!("{drive} {other}"));
        assert_eq!(code, 73, "{other}: {error}");
        assert!(error.contains("drive.mcap exists and is kept"), "{other}: {error}");
        assert_eq!(std::fs::read(here.join("drive.mcap")).unwrap(), made, "{other}");
    }
    assert_eq!(slamd(here, &format!("{drive} --seed 2 --force")).0, 0);
    assert_ne!(std::fs::read(here.join("drive.mcap")).unwrap(), made);
}

#[test]
fn an_import_replaces_only_its_own_recording() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let robot = "[robot]\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 4\nradius_m = 0.15\nhalf_angle_deg = 12.5\n";
    std::fs::write(here.join("robot.toml"), robot).unwrap();
    let csv = |rows: u32| {
        let rows = (0..rows).map(|row| format!("{:.1},{row},{row},1.5,1.5,1.5,1.5\n", 0.1 * f64::from(row)));
        rows.fold("t_s,left_ticks,right_ticks,r0,r1,r2,r3\n".to_owned(), |all, row| all + &row)
    };
    std::fs::write(here.join("one.csv"), csv(40)).unwrap();
    std::fs::write(here.join("two.csv"), csv(40)).unwrap();
    let import =
        |name: &str, more: &str| slamd(here, &format!("import ring {name} --config robot.toml --capture x.mcap{more}"));
    assert_eq!(import("one.csv", "").0, 0);
    let one = std::fs::read(here.join("x.mcap")).unwrap();
    let (code, said) = import("one.csv", "");
    assert!(code == 0 && said.contains("replaces an earlier capture of this recording"), "{said}");
    let (code, said) = import("two.csv", "");
    assert!(code == 0 && said.contains("another recording that was here is now x.earlier-0001.mcap"), "{code} {said}");
    assert_eq!(std::fs::read(here.join("x.earlier-0001.mcap")).unwrap(), one);
    // The same name, another recording.
    let two = std::fs::read(here.join("x.mcap")).unwrap();
    std::fs::write(here.join("two.csv"), csv(41)).unwrap();
    assert_eq!(import("two.csv", "").0, 0);
    assert_eq!(std::fs::read(here.join("x.earlier-0002.mcap")).unwrap(), two);
    // A failed import leaves what was there, and no second name.
    std::fs::write(here.join("bad.csv"), "t_s,left_ticks\n").unwrap();
    assert_eq!(import("bad.csv", "").0, 65);
    assert!(!here.join("x.earlier-0003.mcap").exists());
    assert_eq!(import("one.csv", " --force").0, 0);
    assert!(!here.join("x.earlier-0003.mcap").exists());
    // Neither does it take a simulated drive's place.
    assert_eq!(slamd(here, "simulate --duration 1 --capture x.mcap --force").0, 0);
    assert_eq!(import("two.csv", "").0, 73);
    let (code, said) = slamd(here, "import ring two.csv --config robot.toml --capture -");
    assert!(code == 64 && said.contains("/dev/stdout") && !here.join("-").exists(), "{code} {said}");
}
