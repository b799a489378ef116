//! Strangers at the doors of the real program: they keep nobody out, and leave the session its file descriptors.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use slamd_testkit::served::{Client, SOON, Served, get};
use std::io::Read as _;
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::UnixStream;
use std::process::Command;
use std::time::{Duration, Instant};

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");
const TOKEN: &str = "correct-horse-battery-staple";
/// Long before a silent stranger's time is over.
const AT_ONCE: Duration = Duration::from_secs(3);

/// Connections that say nothing.
fn silent(address: &str, count: usize) -> Vec<TcpStream> {
    (0..count).filter_map(|_| TcpStream::connect(address).ok()).collect()
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
fn silent_strangers_keep_no_owner_out() {
    let folder = tempfile::tempdir().unwrap();
    let token = folder.path().join("token");
    std::fs::write(&token, format!("{TOKEN}\n")).unwrap();
    std::fs::set_permissions(&token, std::fs::Permissions::from_mode(0o600)).unwrap();
    let options = ["--listen", "127.0.0.1:0", "--metrics", "127.0.0.1:0", "--token-file", token.to_str().unwrap()];
    let mut served = Served::new(&options);
    let (address, pages) = (served.address(), served.address());
    let mut early = Served::client(&address);
    early.ask(&format!("?TOKEN=\"{TOKEN}\";"));
    assert_eq!(early.next_line().unwrap()["class"], "VERSION");
    let begin = Instant::now();
    let strangers = [silent(&address, 100), silent(&pages, 100)];
    let mut owner = Served::client(&address);
    owner.ask(&format!("?TOKEN=\"{TOKEN}\";\n?POLL;"));
    assert_eq!(owner.next_line().unwrap()["class"], "VERSION");
    let page = get(&pages, "/metrics", &format!("Authorization: Bearer {TOKEN}\r\n"));
    assert!(page.starts_with("HTTP/1.1 200 "), "{page}");
    assert!(begin.elapsed() < AT_ONCE, "{:?}", begin.elapsed());
    let sent_away = page.lines().find_map(|line| line.strip_prefix("slamd_api_sent_away_total ")).unwrap();
    assert!(sent_away.parse::<u32>().unwrap() > 100, "{sent_away}");
    // Who has lost the place to a newcomer reads why.
    let mut words =
        ["\"class\":\"ERROR\"", "HTTP/1.1 503 "].iter().zip(["a newcomer has this place", "too many connections"]);
    for (strangers, (head, reason)) in strangers.iter().zip(&mut words) {
        let (mut said, mut stranger) = (String::new(), &strangers[0]);
        stranger.set_read_timeout(Some(AT_ONCE)).unwrap();
        stranger.read_to_string(&mut said).unwrap();
        assert!(said.contains(head) && said.contains(reason), "{said:?}");
    }
    // Who has shown the token stays.
    early.ask("?POLL;");
    assert_eq!(early.expect("DEVICE")["link"], "searching");
    drop(strangers);
    served.daemon.end();
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
fn a_full_tcp_port_leaves_places_at_the_socket_of_the_owner() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0", "--socket", "api.sock"]);
    let address = served.address();
    let strangers = silent(&address, 100);
    let begin = Instant::now();
    let stream = UnixStream::connect(served.folder.path().join("api.sock")).unwrap();
    stream.set_read_timeout(Some(AT_ONCE)).unwrap();
    let mut line = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(stream), &mut line).unwrap();
    assert!(line.contains("VERSION") && begin.elapsed() < AT_ONCE, "{line}");
    drop(strangers);
    served.daemon.end();
}

#[test]
fn connections_leave_the_session_its_descriptors() {
    let folder = tempfile::tempdir().unwrap();
    let [port, out, records] = ["board", "out", "records/"].map(|name| folder.path().join(name));
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -n 80 && exec \"$@\"", "sh", SLAMD, "--port"]).arg(&port).arg("--out").arg(&out);
    command.arg("--record").arg(&records).args(["--record-mib", "1", "--session"]).arg(folder.path().join("s.session"));
    command.args(["--listen", "127.0.0.1:0", "--metrics", "127.0.0.1:0"]).current_dir(folder.path());
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    let mut daemon = Daemon::run(command);
    let mut address = || daemon.line("api: listening at", SOON).1.rsplit(' ').next().unwrap().replace("http://", "");
    let (api, pages) = (address(), address());
    let strangers = [silent(&api, 100), silent(&pages, 100)];
    daemon.expect("too few file descriptors are free", SOON);
    // The board is plugged in anew while they stay.
    let board = Plugged::new(&port, Device::new(Board::robot(1), 1));
    daemon.expect("poses and map begin", SOON);
    let device = board.unplug();
    daemon.expect("port missing", SOON);
    let _board = Plugged::new(&port, device);
    daemon.expect("link: streaming", SOON);
    assert!(!daemon.has_said("Too many open files"), "{:?}", daemon.said().collect::<Vec<_>>());
    daemon.end();
    for file in ["out/summary.json", "out/map.png", "s.session"] {
        assert!(folder.path().join(file).exists(), "{file}");
    }
    assert!(std::fs::read_dir(&records).unwrap().count() > 0);
    drop(strangers);
}

#[test]
fn the_limit_of_descriptors_is_raised_and_their_lack_is_named() {
    let mut served = Served::new(&[]);
    served.daemon.expect("port missing", SOON);
    let pid = served.daemon.pid().to_string();
    let limits = std::fs::read_to_string(format!("/proc/{pid}/limits")).unwrap();
    let line = limits.lines().find(|line| line.starts_with("Max open files")).unwrap();
    let mut numbers = line.split_whitespace().skip(3);
    let (soft, hard) = (numbers.next().unwrap(), numbers.next().unwrap());
    assert_eq!(soft, hard);
    let limit = |soft: &str| {
        let status = Command::new("prlimit").args(["--pid", &pid, &format!("--nofile={soft}:{hard}")]).status();
        status.is_ok_and(|status| status.success())
    };
    assert!(limit("4"));
    served.daemon.expect("no file descriptor is free: Too many open files", SOON);
    assert!(limit(hard));
    let _board = served.plug_in(Board::robot(1));
    served.daemon.expect("link: streaming", SOON);
    served.daemon.end();
}

#[test]
fn pages_of_other_sites_get_nothing() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0", "--metrics", "127.0.0.1:0"]);
    let (api, pages) = (served.address(), served.address());
    // What a browser sends for a page whose name was led here, and for one of another port.
    let raw = |host: &str, header: &str| {
        use std::io::{Read as _, Write as _};
        let mut stream = TcpStream::connect(&pages).unwrap();
        write!(stream, "GET /metrics HTTP/1.1\r\nHost: {host}\r\n{header}\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    assert!(raw(&pages, "").starts_with("HTTP/1.1 200 "));
    for (host, header) in [("evil.example:9879", ""), (pages.as_str(), "Origin: http://127.0.0.1:8000\r\n")] {
        let answer = raw(host, header);
        assert!(answer.starts_with("HTTP/1.1 403 ") && !answer.contains("slamd_"), "{answer}");
        assert!(!answer.to_lowercase().contains("access-control-allow"), "{answer}");
    }
    // The port of the JSON lines is no web server: a request of a browser ends the connection.
    let mut client = Client::new(TcpStream::connect(&api).unwrap());
    client.ask("POST / HTTP/1.1\r\nHost: evil.example\r\n\r\n?WATCH;");
    client.expect_end("HTTP");
    served.daemon.end();
}
