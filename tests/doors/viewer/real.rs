//! The real viewer, from PyPI, without a window: on lavapipe, the Vulkan of Debian's mesa-vulkan-drivers.

#![allow(unreachable_pub, reason = "a part of a test")]

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// The same version as ours in Cargo.toml: a viewer reads what its own SDK writes.
const RERUN: &str = "rerun-sdk==0.36.3";

/// The viewer's environment: its Python, its program, its home.
struct Installed {
    python: PathBuf,
    rerun: PathBuf,
    home: PathBuf,
}

fn installed() -> &'static Installed {
    static INSTALLED: OnceLock<Installed> = OnceLock::new();
    INSTALLED.get_or_init(|| {
        let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rerun");
        let python = home.join("bin/python");
        let is_there = Command::new(&python).args(["-c", "import rerun"]).output();
        if !is_there.is_ok_and(|output| output.status.success()) {
            run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&home), "is python3-venv installed?");
            let mut install = Command::new(&python);
            run(install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", RERUN]), "PyPI?");
        }
        // Not the script of that name: it would leave the viewer behind when it is killed.
        let print = "import rerun_cli, os; print(os.path.dirname(rerun_cli.__file__) + '/rerun')";
        let rerun = PathBuf::from(run(Command::new(&python).args(["-c", print]), "rerun_cli").trim());
        run(Command::new(&rerun).env("HOME", &home).args(["analytics", "disable"]), "analytics");
        Installed { python, rerun, home }
    })
}

fn run(command: &mut Command, hint: &str) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}; {hint}"));
    assert!(output.status.success(), "{command:?}: {}; {hint}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// `rerun rrd COMMAND FILE`; what it prints.
pub fn rrd(command: &str, file: &Path) -> String {
    let Installed { rerun, home, .. } = installed();
    run(Command::new(rerun).env("HOME", home).args(["rrd", command]).arg(file), "rerun rrd")
}

/// Runs a script with the viewer's Python.
pub fn python(script: &str, argument: &Path) -> String {
    let Installed { python, home, .. } = installed();
    run(Command::new(python).env("HOME", home).args(["-c", script]).arg(argument), "python")
}

/// A free port.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A viewer that runs.
pub struct Viewer {
    child: Child,
    port: u16,
    _runtime: tempfile::TempDir,
}

/// A screenshot's colours, and where it is.
pub struct Shot {
    /// Red, green, blue of each pixel.
    pixels: Vec<[u8; 3]>,
    /// The file.
    pub path: PathBuf,
}

/// How far a shown colour may be from the one that was logged.
const NEAR: i16 = 30;

impl Viewer {
    /// Starts one that listens on a port and shows a file, or what a server has, if given.
    pub fn start(port: u16, size: &str, what: Option<&str>) -> Self {
        let Installed { rerun, home, .. } = installed();
        let runtime = tempfile::tempdir().unwrap();
        let mut command = Command::new(rerun);
        command.env("HOME", home).env("XDG_RUNTIME_DIR", runtime.path());
        command.args(["--headless", "--bind", "127.0.0.1", "--port", &port.to_string(), "--window-size", size]);
        command.args(["--hide-welcome-screen", "--memory-limit", "1GB"]).args(what);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        Self { child, port, _runtime: runtime }
    }

    /// Takes screenshots until one is as wanted.
    ///
    /// # Panics
    /// When none is in time.
    #[expect(clippy::disallowed_methods, reason = "a viewer lives in real time")]
    pub fn shows(&self, name: &str, is_it: impl Fn(&Shot) -> bool) -> Shot {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/viewer");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(name);
        let end = Instant::now() + Duration::from_secs(90);
        let mut last = None;
        while Instant::now() < end {
            std::thread::sleep(Duration::from_secs(2));
            if let Some(shot) = self.shoot(&path) {
                if is_it(&shot) {
                    return shot;
                }
                last = Some(shot);
            }
        }
        panic!(
            "{}: not what was expected: {}",
            path.display(),
            last.map_or_else(|| "nothing".into(), |shot| shot.census())
        );
    }

    fn shoot(&self, path: &Path) -> Option<Shot> {
        let Installed { python, home, .. } = installed();
        let script = format!(
            "import sys; from rerun.experimental import ViewerClient\n\
             ViewerClient.connect('rerun+http://127.0.0.1:{}/proxy').save_screenshot(sys.argv[1])",
            self.port
        );
        let _ = std::fs::remove_file(path);
        let output = Command::new(python).env("HOME", home).args(["-c", &script]).arg(path).output().ok()?;
        let picture = tiny_skia::Pixmap::load_png(path).ok().filter(|_| output.status.success())?;
        let pixels = picture.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
        Some(Shot { pixels, path: path.into() })
    }

    /// A signal by its name.
    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-s", name, &id]).status().unwrap().success());
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Shot {
    /// Pixels of about this colour.
    pub fn count(&self, colour: [u8; 3]) -> usize {
        let is_near = |(a, b): (&u8, &u8)| (i16::from(*a) - i16::from(*b)).abs() <= NEAR;
        self.pixels.iter().filter(|pixel| pixel.iter().zip(&colour).all(is_near)).count()
    }

    /// What is in it, by [`COLOURS`].
    pub fn census(&self) -> String {
        COLOURS.map(|(name, colour)| format!("{name} {}", self.count(colour))).join(", ")
    }
}

/// What has which colour: see `src/viewer/style.rs`.
pub const UNKNOWN: [u8; 3] = [112, 137, 134];
pub const FREE: [u8; 3] = [245, 245, 245];
pub const PATH: [u8; 3] = [30, 110, 255];
pub const ODOMETRY: [u8; 3] = [245, 158, 11];
pub const FAULTY: [u8; 3] = [235, 50, 50];
pub const WALL: [u8; 3] = [13, 148, 136];
const COLOURS: [(&str, [u8; 3]); 6] =
    [("unknown", UNKNOWN), ("free", FREE), ("path", PATH), ("odometry", ODOMETRY), ("faulty", FAULTY), ("walls", WALL)];
