//! The real program with its doors open, and clients that come in.

use crate::mock_port::daemon::Daemon;
use crate::mock_port::{Board, Device, Plugged};
use serde_json::Value;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

pub const SOON: Duration = Duration::from_secs(20);

/// slamd with a board plugged in, or not yet.
pub struct Served {
    pub daemon: Daemon,
    pub folder: tempfile::TempDir,
}

impl Served {
    pub fn new(options: &[&str]) -> Self {
        Self::with(options, &[])
    }

    /// The same with these variables.
    pub fn with(options: &[&str], variables: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(crate::program());
        command.arg("--port").arg(folder.path().join("board")).arg("--out").arg(folder.path().join("out"));
        command.args(options).envs(variables.iter().copied()).current_dir(folder.path());
        if cfg!(feature = "viewer") {
            command.args(["--viewer", "off"]);
        }
        Self { daemon: Daemon::run(command), folder }
    }

    pub fn board(&self) -> PathBuf {
        self.folder.path().join("board")
    }

    pub fn plug_in(&self, board: Board) -> Plugged {
        Plugged::new(&self.board(), Device::new(board, 1))
    }

    /// The next address that is listened at.
    pub fn address(&mut self) -> String {
        let (_, line) = self.daemon.line("api: listening at", SOON);
        line.rsplit(' ').next().unwrap().trim_start_matches("http://").to_owned()
    }

    pub fn client(address: &str) -> Client {
        Client::new(TcpStream::connect(address).unwrap())
    }
}

/// A client that waits for lines.
pub struct Client {
    pub stream: TcpStream,
    lines: BufReader<TcpStream>,
}

impl Client {
    pub fn new(stream: TcpStream) -> Self {
        stream.set_read_timeout(Some(Duration::from_secs(25))).unwrap();
        let lines = BufReader::new(stream.try_clone().unwrap());
        Self { stream, lines }
    }

    pub fn ask(&mut self, request: &str) {
        writeln!(self.stream, "{request}").unwrap();
    }

    /// The next line; none where there will be no more.
    pub fn next_line(&mut self) -> Option<Value> {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        (!line.is_empty()).then(|| serde_json::from_str(&line).unwrap())
    }

    /// The next line of a class, others left out.
    pub fn expect(&mut self, class: &str) -> Value {
        std::iter::from_fn(|| self.next_line())
            .find(|line| line["class"] == class)
            .unwrap_or_else(|| panic!("no {class}"))
    }

    /// The last line, which must be an error with these words.
    pub fn expect_end(&mut self, words: &str) {
        let last = std::iter::from_fn(|| self.next_line()).last().expect("a last word");
        assert!(last["class"] == "ERROR" && last["message"].as_str().unwrap().contains(words), "{last}");
    }
}

/// An answer over HTTP.
pub fn get(address: &str, path: &str, header: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(25))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\n{header}\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}
