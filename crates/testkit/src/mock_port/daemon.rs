//! The real program under test: its log line by line, its process's resources.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// `slamd --port PORT --out OUT`.
pub struct Daemon {
    child: Child,
    lines: Receiver<(Instant, String)>,
    log: Vec<String>,
}

impl Daemon {
    pub fn start(port: &str, out: &Path) -> Self {
        Self::start_with(port, out, &[])
    }

    /// The same with further options.
    pub fn start_with(port: &str, out: &Path, options: &[&str]) -> Self {
        let mut command = Command::new(crate::program());
        command.arg("--port").arg(port).arg("--out").arg(out).args(options);
        if cfg!(feature = "viewer") {
            command.args(["--viewer", "off"]);
        }
        Self::run(command)
    }

    #[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
    pub fn run(mut command: Command) -> Self {
        // Without the configuration of the user who runs the tests.
        if !command.get_envs().any(|(name, _)| name == "XDG_CONFIG_HOME" || name == "HOME") {
            command.env("XDG_CONFIG_HOME", "/nonexistent");
        }
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it runs");
        let stderr = BufReader::new(child.stderr.take().expect("its log"));
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                if sender.send((Instant::now(), line)).is_err() {
                    return;
                }
            }
        });
        Self { child, lines, log: Vec::new() }
    }

    /// Waits for a line of the log that contains `words`, and says when it came.
    ///
    /// # Panics
    /// When none comes in time.
    pub fn expect(&mut self, words: &str, within: Duration) -> Instant {
        self.line(words, within).0
    }

    /// The same, with the line.
    ///
    /// # Panics
    /// When none comes in time.
    #[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
    pub fn line(&mut self, words: &str, within: Duration) -> (Instant, String) {
        let end = Instant::now() + within;
        while let Ok((at, line)) = self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
            self.log.push(line.clone());
            if line.contains(words) {
                return (at, line);
            }
        }
        panic!("no line with \"{words}\" within {within:?}; the log so far:\n{}", self.log.join("\n"));
    }

    /// True where a line with these words has come so far.
    pub fn has_said(&mut self, words: &str) -> bool {
        self.log.extend(self.lines.try_iter().map(|(_, line)| line));
        self.log.iter().any(|line| line.contains(words))
    }

    /// The lines that came so far.
    pub fn said(&mut self) -> impl Iterator<Item = &str> {
        self.log.extend(self.lines.try_iter().map(|(_, line)| line));
        self.log.iter().map(String::as_str)
    }

    /// Ends it as a service manager does.
    pub fn end(mut self) {
        let _ = Command::new("kill").arg(self.child.id().to_string()).status();
        let status = self.child.wait().expect("it ends");
        self.log.extend(self.lines.try_iter().map(|(_, line)| line));
        assert!(is_orderly(status), "{status}; the log:\n{}", self.log.join("\n"));
    }

    /// Waits until it ends by itself.
    pub fn wait(mut self) {
        let status = self.child.wait().expect("it ends");
        self.log.extend(self.lines.iter().map(|(_, line)| line));
        assert!(is_orderly(status), "{status}; the log:\n{}", self.log.join("\n"));
    }

    /// Its process number.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Open file descriptors.
    pub fn descriptors(&self) -> usize {
        std::fs::read_dir(format!("/proc/{}/fd", self.pid())).expect("it runs").count()
    }

    /// Resident memory, KiB.
    pub fn resident_kib(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.pid())).expect("it runs");
        let line = status.lines().find(|line| line.starts_with("VmRSS")).expect("a size");
        line.split_whitespace().nth(1).and_then(|number| number.parse().ok()).expect("a number")
    }

    /// Processor time used so far, in the kernel's ticks of 10 ms.
    pub fn cpu_ticks(&self) -> u64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.pid())).expect("it runs");
        let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
        [11, 12].iter().filter_map(|&field| fields.get(field)?.parse::<u64>().ok()).sum()
    }
}

/// Many sessions of tests are too short for a map, and say so.
fn is_orderly(status: ExitStatus) -> bool {
    status.success() || status.code() == Some(75)
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
