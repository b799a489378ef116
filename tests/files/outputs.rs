//! Every option that names an output, against whatever may be in its way. The tables are in `docs/outputs.md`:
//! `WRITE_GOLDEN=1 cargo test --no-default-features --test files outputs` writes them.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::fmt::Write as _;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");
const PRECIOUS: &str = "precious";
/// A disk without room at DISK; what is on it afterwards goes to LIST.
const ON_A_FULL_DISK: &str = "mount -t tmpfs -o size=4k full \"$DISK\" && head -c 4096 /dev/zero >\"$DISK/ballast\"; \
    \"$@\"; code=$?; ls -A \"$DISK\" >\"$LIST\"; exit $code";

/// An option, the command's input, and the command with TARGET for the output.
const OPTIONS: &[(&str, &str, &str)] = &[
    ("import ring --capture", "drive.csv", "import ring drive.csv --config robot.toml --capture TARGET"),
    ("import carmen --capture", "drive.log", "import carmen drive.log --config robot.toml --capture TARGET"),
    ("import bag --capture", "bag.mcap", "import bag bag.mcap --config robot.toml --capture TARGET"),
    ("simulate --capture", "room.toml", "simulate --world room.toml --duration 5 --capture TARGET"),
    ("calibrate --out", "drive.mcap", "calibrate drive.mcap --out TARGET"),
    ("export --mcap", "drive.mcap", "export drive.mcap --mcap TARGET"),
    ("export --csv", "drive.mcap", "export drive.mcap --csv TARGET"),
    ("export --tum", "drive.mcap", "export drive.mcap --tum TARGET"),
    ("export --svg", "drive.mcap", "export drive.mcap --svg TARGET"),
    ("replay --save-session", "drive.mcap", "replay drive.mcap --out results --save-session TARGET"),
    ("replay --session", "drive.mcap", "replay drive.mcap --out results --session TARGET"),
    ("replay --save-calibration", "drive.mcap", "replay drive.mcap --out results --save-calibration TARGET"),
    ("bench accuracy --out", "-", "bench accuracy world=room --seeds 101 --seconds 10 --out TARGET"),
    // Setup refuses the file before it opens the port. A setup with a board would take minutes.
    ("setup --out, no board", "-", "setup --yes --port nowhere --out TARGET"),
    ("run --record", "robot.toml", "run --port board --duration 0.5 --config robot.toml --out results --record TARGET"),
    (
        "run --save-session",
        "robot.toml",
        "run --port board --duration 0.5 --config robot.toml --out results --save-session TARGET",
    ),
    (
        "run --save-calibration",
        "robot.toml",
        "run --port board --duration 0.5 --config robot.toml --out results --save-calibration TARGET",
    ),
];

struct Desk {
    folder: TempDir,
    _board: Plugged,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("robot.toml"), "[robot]\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 32\nradius_m = 0.15\nhalf_angle_deg = 12.5\ngroups = 4\n").unwrap();
        std::fs::write(path("drive.csv"), csv()).unwrap();
        std::fs::write(path("drive.log"), log()).unwrap();
        std::fs::write(path("other.csv"), csv().replace(",1.5", ",1.4")).unwrap();
        let world = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/worlds/corner.toml");
        std::fs::copy(world, path("room.toml")).unwrap();
        let board = Plugged::new(&path("board"), Device::new(Board::robot(1), 1));
        let desk = Self { folder, _board: board };
        for line in [
            "simulate --world flat --duration 30 --capture drive.mcap",
            "import ring other.csv --config robot.toml --capture made.mcap",
            "export drive.mcap --mcap bag.mcap",
        ] {
            let output = desk.slamd(line, None);
            assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
        }
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn slamd(&self, line: &str, target: Option<&str>) -> Output {
        let words = line.split(' ').map(|word| if word == "TARGET" { target.unwrap() } else { word });
        let mut command = Command::new(SLAMD);
        command.args(words).current_dir(self.folder.path()).env("XDG_CONFIG_HOME", "/nonexistent");
        command.output().unwrap()
    }

    /// All files, so that a half one is found.
    fn listing(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// What comes of a command onto an existing `target`.
    fn onto(&self, line: &str, target: &str) -> String {
        let (before, listed) = (self.content(target), self.listing());
        let output = self.slamd(line, Some(target));
        let now = self.listing();
        let new: Vec<&String> = now.iter().filter(|name| !listed.contains(name) && *name != "results").collect();
        let what = if self.content(target) == before { "kept" } else { "replaced" };
        let code = output.status.code().unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(!error.contains(".part"), "{line}: a temporary name is shown: {error}");
        assert!(
            what == "replaced" || code != 0 || !new.is_empty(),
            "{line} {target}: nothing was written, and nothing is said"
        );
        let beside = match new.as_slice() {
            [] => String::new(),
            [one] => {
                assert!(error.contains(one.as_str()), "{line}: it is not said that {one} was written: {error}");
                let is_earlier = one.contains(".earlier-0001");
                assert!(!is_earlier || self.content(one) == before, "{line}: {one} is not what was there");
                self.remove(one);
                if is_earlier { ", kept as .earlier-0001".into() } else { ", beside it -0002".into() }
            }
            many => panic!("{line}: {many:?}"),
        };
        self.remove("results");
        format!("{code}, {what}{beside}")
    }

    fn content(&self, name: &str) -> Option<Vec<u8>> {
        std::fs::read(self.path(name)).ok()
    }

    fn remove(&self, name: &str) {
        let path = self.path(name);
        if path.is_dir() {
            std::fs::remove_dir_all(path).unwrap();
        } else if path.symlink_metadata().is_ok() {
            std::fs::remove_file(path).unwrap();
        }
    }

    /// The same onto a file with this content.
    fn onto_new(&self, line: &str, content: &[u8], mode: u32) -> String {
        std::fs::write(self.path("target.x"), content).unwrap();
        std::fs::set_permissions(self.path("target.x"), std::fs::Permissions::from_mode(mode)).unwrap();
        let cell = self.onto(line, "target.x");
        self.remove("target.x");
        cell
    }

    fn on_a_full_disk(&self, line: &str) -> String {
        let [disk, list] = ["disk", "list"].map(|name| self.path(name));
        std::fs::create_dir(&disk).unwrap();
        let target = disk.join("target.x");
        let words = line.split(' ').map(|word| if word == "TARGET" { target.to_str().unwrap() } else { word });
        let mut command = Command::new("unshare");
        command.env("DISK", &disk).env("LIST", &list).env("XDG_CONFIG_HOME", "/nonexistent");
        command.args(["-rm", "sh", "-c", ON_A_FULL_DISK, "sh", SLAMD]).args(words).current_dir(self.folder.path());
        let output = command.output().unwrap();
        let left = std::fs::read_to_string(&list).unwrap();
        let error = String::from_utf8_lossy(&output.stderr);
        for name in ["disk", "list", "results"] {
            self.remove(name);
        }
        assert!(!error.contains(".part"), "{line}: a temporary name is shown: {error}");
        let what = if left == "ballast\n" {
            "nothing left".into()
        } else {
            format!("left: {}", left.trim().replace('\n', " "))
        };
        format!("{}, {what}", output.status.code().unwrap())
    }
}

fn csv() -> String {
    let names: Vec<String> = (0..32).map(|sensor| format!("r{sensor}")).collect();
    let rows = (0..50u32).map(|k| format!("{:.1},{},{}{}\n", 0.1 * f64::from(k), 40 * k, 40 * k, ",1.5".repeat(32)));
    format!("t_s,left_ticks,right_ticks,{}\n{}", names.join(","), rows.collect::<String>())
}

fn log() -> String {
    let offsets = " 0.1 0 0".repeat(32);
    (0..50u32)
        .map(|k| {
            let t_s = 0.1 * f64::from(k);
            format!(
                "ODOM {x:.3} 0 0 0.1 0 0 {t_s:.1} bot {t_s:.1}\nSONAR 0.4 32{}{offsets} {t_s:.1} bot {t_s:.1}\n",
                " 1.5".repeat(32),
                x = 0.01 * f64::from(k)
            )
        })
        .collect()
}

/// The page's text from a line on is the table, or is written.
fn compare(heading: &str, table: &str) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/outputs.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let (before, rest) =
        text.split_once(&format!("{heading}\n\n")).unwrap_or_else(|| panic!("no `{heading}` in the page"));
    let end = rest.find("\n\n").map_or(rest.len(), |end| end + 1);
    let (old, after) = rest.split_at(end);
    if std::env::var_os("WRITE_GOLDEN").is_some() {
        std::fs::write(&page, format!("{before}{heading}\n\n{table}{after}")).unwrap();
        return;
    }
    assert_eq!(old, table, "docs/outputs.md: WRITE_GOLDEN=1 writes it anew");
}

#[test]
fn no_option_writes_over_what_it_should_keep() {
    let may_mount = Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "full", "/mnt"]).status();
    if !may_mount.is_ok_and(|status| status.success()) {
        println!("skipped: this machine lets nobody mount a small disk");
        return;
    }
    let desk = Desk::new();
    let made = std::fs::read(desk.path("made.mcap")).unwrap();
    let mut table = String::from(
        "| option | its input | an existing file | the same, --force | another imported capture | a folder | read-only, --force | a full disk |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (option, input, line) in OPTIONS {
        let force =
            if line.starts_with("run") { line.replacen("run ", "run --force ", 1) } else { format!("{line} --force") };
        std::fs::create_dir(desk.path("folder")).unwrap();
        let cells = [
            if *input == "-" { "-".into() } else { desk.onto(&force, input) },
            desk.onto_new(line, PRECIOUS.as_bytes(), 0o644),
            desk.onto_new(&force, PRECIOUS.as_bytes(), 0o644),
            desk.onto_new(line, &made, 0o644),
            format!("{}, kept", desk.slamd(&force, Some("folder")).status.code().unwrap()),
            desk.onto_new(&force, PRECIOUS.as_bytes(), 0o444),
            desk.on_a_full_disk(line),
        ];
        desk.remove("results");
        let left = std::fs::read_dir(desk.path("folder")).unwrap().count();
        assert!(left == 0 || option.contains("record"), "{option}");
        desk.remove("folder");
        writeln!(table, "| `{option}` | {} |", cells.join(" | ")).unwrap();
        assert!(cells[0] == "-" || cells[0].contains("kept"), "{option}: {}", cells[0]);
        assert!(cells[1].contains("kept"), "{option}: {}", cells[1]);
        assert!(cells[5].contains("kept"), "{option}: {}", cells[5]);
    }
    compare("## Files", &table);
}

/// Leaves the results of a run in `results`.
fn held(desk: &Desk, kind: &str) {
    desk.remove("results");
    match kind {
        "a replay's results" => assert!(desk.slamd("replay drive.mcap --out results", None).status.success()),
        "a robot's drive" => {
            assert!(desk.slamd("replay drive.mcap --out results", None).status.success());
            let file = desk.path("results/summary.json");
            let text = std::fs::read_to_string(&file).unwrap();
            std::fs::write(&file, text.replace("\"capture\": \"drive.mcap\"", "\"capture\": null")).unwrap();
        }
        "a file" => std::fs::write(desk.path("results"), PRECIOUS).unwrap(),
        "its input" => {
            std::fs::create_dir(desk.path("results")).unwrap();
            std::fs::copy(desk.path("robot.toml"), desk.path("results/config.toml")).unwrap();
        }
        other => panic!("{other}"),
    }
}

#[test]
fn no_folder_is_written_over() {
    let desk = Desk::new();
    std::fs::copy(desk.path("drive.csv"), desk.path("still.csv")).unwrap();
    let still = csv().lines().map(|line| line.replacen(",40", ",0", 1)).collect::<Vec<_>>().join("\n");
    std::fs::write(desk.path("still.csv"), still).unwrap();
    let kinds = ["its input", "a file", "a replay's results", "a robot's drive"];
    let mut table = format!("| option | {} |\n|---|---|---|---|---|\n", kinds.join(" | "));
    for (option, line) in [
        ("replay --out", "replay drive.mcap --config results/config.toml --out results"),
        ("replay --out, --force", "replay drive.mcap --config results/config.toml --out results --force"),
        ("replay --out, nothing mapped", "replay made.mcap --config results/config.toml --out results"),
        ("run --out, nothing mapped", "run --port board --duration 0.5 --config results/config.toml --out results"),
        ("run --out", "run --port board --duration 14 --config results/config.toml --out results"),
    ] {
        let mut row = format!("| `{option}` |");
        for kind in kinds {
            held(&desk, kind);
            let line =
                if kind == "its input" { line.to_owned() } else { line.replace(" --config results/config.toml", "") };
            let names = ["results", "results/config.toml", "results/map.pgm", "results/summary.json"];
            let before: Vec<_> = names.iter().map(|name| desk.content(name)).collect();
            let code = desk.slamd(&line, None).status.code().unwrap();
            let after: Vec<_> = names.iter().map(|name| desk.content(name)).collect();
            let is_moved = desk.content("results/earlier-0001/map.pgm").is_some_and(|map| Some(map) == before[2]);
            let what = match (before == after, is_moved) {
                (true, _) => "kept",
                (false, true) => "moved to earlier-0001",
                (false, false) => "replaced",
            };
            write!(row, " {code}, {what} |").unwrap();
        }
        assert!(!row.contains("its input | 0"), "{row}");
        table += &row;
        table.push('\n');
    }
    desk.remove("results");
    compare("## Folders", &table);
}
