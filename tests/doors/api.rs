//! The JSON lines of the real program, as other programs meet them.

#![allow(clippy::unwrap_used, reason = "a test may")]

use serde_json::Value;
use slamd::api::Report;
use slamd_core::{ModelAspect, ModelEvent, ModelFinding, ModelState, Timestamp};
use slamd_protocol::{PayloadBuf, encode_frame};
use slamd_testkit::mock_port::{Board, Terminal};
use slamd_testkit::served::{Client, SOON, Served, get};
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

#[test]
fn the_example_prints_poses() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0"]);
    let address = served.address();
    let _board = served.plug_in(Board::robot(1));
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/watch.py");
    let text = std::fs::read_to_string(&example).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() <= 10, "ten lines are enough, not {}", lines.len());
    let readme = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    assert!(readme.contains(&lines[2..].join("\n")), "the README shows another example");
    let mut python = Command::new("python3").arg(&example).arg(&address).stdout(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(python.stdout.take().unwrap()).lines().take(5);
    let lines: Vec<String> = lines.map_while(Result::ok).collect();
    python.kill().unwrap();
    python.wait().unwrap();
    assert_eq!(lines.len(), 5, "{lines:?}");
    // `| head` closes the pipe: that ends it without a complaint.
    let piped = format!("python3 {} {address} | head -n 2", example.display());
    let output = Command::new("sh").args(["-c", &piped]).output().unwrap();
    assert!(output.stderr.is_empty() && output.stdout.split(|byte| *byte == b'\n').count() == 3, "{output:?}");
    assert!(lines.iter().all(|line| line.contains(" s: x ") && line.ends_with(" rad")), "{lines:?}");
    served.daemon.end();
}

/// What `socat` and `jq` make of poses that are asked for at `at`, an address of socat's: five lines of three numbers.
fn poses_by_jq(at: &str) -> Vec<f64> {
    let piped = Stdio::piped;
    let mut socat = Command::new("socat").args(["-", at]).stdin(piped()).stdout(piped()).spawn().unwrap();
    let poses = "select(.class == \"POSE\") | [.time_s, .x_m, .theta_rad] | @tsv";
    let lines = socat.stdout.take().unwrap();
    let mut jq = Command::new("jq").args(["--unbuffered", "-r", poses]).stdin(lines).stdout(piped()).spawn().unwrap();
    writeln!(socat.stdin.as_mut().unwrap(), "?WATCH={{\"pose_hz\":5}};").unwrap();
    let lines = BufReader::new(jq.stdout.take().unwrap()).lines().take(5);
    let lines: Vec<String> = lines.map_while(Result::ok).collect();
    for mut program in [socat, jq] {
        program.kill().unwrap();
        program.wait().unwrap();
    }
    lines.iter().flat_map(|line| line.split_whitespace()).map(|number| number.parse().unwrap()).collect()
}

#[test]
fn socat_and_jq_read_poses_over_tcp_and_the_socket() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0", "--socket", "api.sock"]);
    let address = served.address();
    let _board = served.plug_in(Board::robot(1));
    for at in [format!("TCP:{address}"), format!("UNIX-CONNECT:{}", served.folder.path().join("api.sock").display())] {
        let numbers = poses_by_jq(&at);
        assert_eq!(numbers.len(), 15, "{numbers:?}");
        assert!(numbers.chunks(3).zip(numbers.chunks(3).skip(1)).all(|(a, b)| a[0] < b[0]), "{numbers:?}");
    }
    served.daemon.end();
}

/// The fields that `docs/api.md` names, by class.
fn documented() -> BTreeMap<String, Vec<String>> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/api.md")).unwrap();
    let mut fields = BTreeMap::<String, Vec<String>>::new();
    let mut class = None;
    for line in text.lines() {
        if let Some(title) = line.strip_prefix('#') {
            class = title.strip_prefix("## ").map(str::to_owned);
        }
        let (Some(class), Some(row)) = (&class, line.strip_prefix("| ")) else { continue };
        let names = row.split(" | ").next().unwrap().split(", ").filter(|name| *name != "field");
        fields.entry(class.clone()).or_default().extend(names.map(str::to_owned));
    }
    fields.values_mut().for_each(|names| names.sort());
    fields
}

/// The fields of a report, those of the objects in its lists after a dot.
fn fields(report: &Value) -> Vec<String> {
    let mut fields = Vec::new();
    for (name, value) in report.as_object().unwrap().iter().filter(|(name, _)| *name != "class") {
        fields.push(name.clone());
        let inside = value.as_array().and_then(|list| list.first()?.as_object());
        fields.extend(inside.into_iter().flat_map(|object| object.keys()).map(|inner| format!("{name}.{inner}")));
    }
    fields.sort();
    fields
}

#[test]
fn every_field_of_every_report_is_documented_and_the_reverse() {
    let mut served = Served::new(&["--socket", "api.sock", "--drive"]);
    let address = served.address();
    assert_eq!(address, "api.sock");
    let socket = served.folder.path().join(&address);
    assert_eq!(std::fs::metadata(&socket).unwrap().permissions().mode() & 0o777, 0o600);
    let _board = served.plug_in(Board::broken(1, &["3:missing"]));
    let mut stream = UnixStream::connect(&socket).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(25))).unwrap();
    writeln!(stream, "?WATCH={{\"pose_hz\":1,\"sweep_hz\":1,\"map_hz\":1,\"stats_hz\":1}};\n?NONSENSE;\n?STOP;")
        .unwrap();
    let mut sent = BTreeMap::from([("MODEL".to_owned(), fields(&model()))]);
    for line in BufReader::new(&stream).lines() {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let class = line["class"].as_str().unwrap().to_owned();
        if class == "DEVICE" && line["sensors"].as_array().unwrap().is_empty() {
            continue;
        }
        if class == "FAULT" {
            assert!(line["sensor"] == 3 && line["state"] == "missing", "{line}");
        }
        if class == "MAP" {
            check_map(&line);
        }
        sent.insert(class, fields(&line));
        if sent.len() == documented().len() {
            break;
        }
    }
    assert_eq!(sent, documented());
    drop(stream);
    served.daemon.end();
    assert!(!socket.exists(), "the socket goes with its program");
}

/// A report that no healthy robot gives.
fn model() -> Value {
    let finding = ModelFinding {
        aspect: ModelAspect::WheelScale,
        measured: 4.0,
        sigma: 0.1,
        clause: "the wheels report 4.0 times the travel that the walls show".into(),
        remedies: vec![("robot.ticks_per_turn", "1440".into())],
    };
    let event =
        ModelEvent { at: Timestamp::default(), since: Timestamp::default(), finding, state: ModelState::Doubted };
    serde_json::from_slice(&Report::model(&event).line()).unwrap()
}

/// The picture is what the fields say, and has the greys of `map.pgm`.
fn check_map(map: &Value) {
    use base64::Engine as _;
    let text = map["png_base64"].as_str().unwrap();
    let file = base64::engine::general_purpose::STANDARD.decode(text).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(
        (u64::from(info.width), u64::from(info.height)),
        (map["width"].as_u64().unwrap(), map["height"].as_u64().unwrap())
    );
    let count = |grey: u8| pixels.iter().filter(|pixel| **pixel == grey).count();
    assert_eq!(count(254) + count(0) + count(205), pixels.len());
    assert!(count(254) > 100 && count(205) > 100, "{} free, {} unknown", count(254), count(205));
}

#[test]
fn limits_are_enforced_and_reported() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0"]);
    let address = served.address();
    let mut idle = Served::client(&address);
    let mut long = Served::client(&address);
    long.stream.write_all(&[b'x'; 65 << 10]).unwrap();
    long.expect_end("more than 65536 bytes");
    served.daemon.expect("line too long", SOON);
    drop(long);
    let is_in = |client: &mut Client| client.next_line().is_some_and(|line| line["class"] == "VERSION");
    let mut clients = Vec::new();
    while clients.len() < 63 {
        let mut client = Served::client(&address);
        if is_in(&mut client) {
            clients.push(client);
        }
    }
    let mut surplus = Served::client(&address);
    surplus.ask("?POLL;");
    surplus.expect_end("too many clients");
    clients.pop();
    while !is_in(&mut Served::client(&address)) {}
    idle.expect_end("idle for 20 s");
    served.daemon.end();
}

#[test]
fn a_client_that_does_not_read_is_dropped_and_the_pipeline_loses_nothing() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0"]);
    let address = served.address();
    let board = served.plug_in(Board::robot(2));
    let mut good = Served::client(&address);
    good.ask("?WATCH={\"sweep_hz\":50,\"stats_hz\":1,\"pose_hz\":0};");
    good.expect("SWEEP");
    // The first frame may have been cut when the port was opened.
    let lost = |stats: &Value| ["dropped_sweeps", "crc_errors"].map(|key| stats[key].as_u64());
    let before = lost(&good.expect("STATS"));
    let mut bad = Served::client(&address);
    bad.stream.set_write_timeout(Some(Duration::from_millis(200))).unwrap();
    bad.ask("?WATCH={\"sweep_hz\":50,\"pose_hz\":50};");
    // Answers of 3 MB; whether all is taken does not matter.
    let _ = bad.stream.write_all("?VERSION;\n".repeat(40_000).as_bytes());
    served.daemon.expect("dropped: too slow", SOON);
    bad.expect_end("too slow");
    // Nobody else has noticed.
    let (mut last, mut sweeps) = (None, 0);
    while sweeps < 30 {
        let sweep = good.expect("SWEEP")["sweep"].as_u64().unwrap();
        assert!(last.is_none_or(|last| sweep == last + 1), "{last:?} {sweep}");
        (last, sweeps) = (Some(sweep), sweeps + 1);
    }
    let stats = good.expect("STATS");
    assert_eq!(stats["dropped_sweeps"], 0, "{stats}");
    // What a crowded machine let overflow on the line, before slamd had it, is none of the client's doing.
    assert!(lost(&stats) == before || board.lost_bytes() > 0, "{before:?} {stats}");
    served.daemon.end();
    let summary = std::fs::read_to_string(served.folder.path().join("out/summary.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&summary).unwrap()["dropped"], 0, "{summary}");
}

const TOKEN: &str = "correct-horse-battery-staple";

#[test]
fn tcp_clients_must_send_the_token() {
    let folder = tempfile::tempdir().unwrap();
    let token = folder.path().join("token");
    std::fs::write(&token, format!("{TOKEN}\n")).unwrap();
    std::fs::set_permissions(&token, std::fs::Permissions::from_mode(0o600)).unwrap();
    let options = ["--listen", "0.0.0.0:0", "--metrics", "127.0.0.1:0", "--token-file", token.to_str().unwrap()];
    let mut served = Served::new(&options);
    let address = served.address().replace("0.0.0.0", "127.0.0.1");
    let page = served.address();
    let mut silent = Served::client(&address);
    let mut guessing = Served::client(&address);
    guessing.ask("?POLL;\n?TOKEN=\"correct-horse-battery-stapl\";");
    assert!(guessing.next_line().unwrap()["message"].as_str().unwrap().contains("begin with the right ?TOKEN"));
    guessing.ask("?TOKEN;");
    guessing.expect_end("three times");
    let mut known = Served::client(&address);
    known.ask(&format!("?TOKEN=\"{TOKEN}\";\n?POLL;"));
    assert_eq!(known.next_line().unwrap()["class"], "VERSION");
    assert_eq!(known.expect("DEVICE")["link"], "searching");
    silent.expect_end("no token within 5 s");
    served.daemon.expect("wrong or missing token", SOON);
    assert!(get(&page, "/metrics", "").starts_with("HTTP/1.1 401 "));
    assert!(get(&page, "/metrics", &format!("Authorization: Bearer {TOKEN}\r\n")).starts_with("HTTP/1.1 200 "));
    served.daemon.end();
}

#[test]
fn network_access_needs_a_private_token_file() {
    let fails = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        let output = command.args(["--port", "/dev/nowhere", "--exit-on-hangup"]).args(options).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    for option in ["--listen", "--metrics"] {
        let (code, words) = fails(&[option, "0.0.0.0:0"]);
        assert!(code == 64 && words.contains("--token-file") && words.contains("ssh -L"), "{code}: {words}");
    }
    let (code, words) = fails(&["--listen", "127.0.0.1:0", "--token-file", env!("CARGO_BIN_EXE_slamd")]);
    assert!(code == 78 && words.contains("chmod 600"), "{code}: {words}");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let (code, words) = fails(&["--listen", &taken.local_addr().unwrap().to_string()]);
    assert!(code == 69 && words.contains("in use"), "{code}: {words}");
}

/// HELLO, as a board sends it that wants to play tricks on a terminal; and a line of its log.
fn tricks() -> Vec<u8> {
    let mut hello = vec![slamd_protocol::VERSION_MAJOR, 0];
    hello.extend(7u32.to_le_bytes());
    hello.extend(1_000_000u32.to_le_bytes());
    hello.push(32);
    [1440u32, 0, 0].iter().for_each(|number| hello.extend(number.to_le_bytes()));
    hello.extend(b"slamdsim");
    hello.extend(b"ev\x1b[2Jil\r\n\x07\xC2\x9B\0\0\0");
    hello.extend(b"1\x1b]0;x\x07\0\0\0\0\0\0\0\0\0");
    let log = b"\x02hel\x1b[31mlo\rw\norld\x08".to_vec();
    [(1, hello), (0x3F, log)].iter().flat_map(|(kind, payload)| framed(*kind, payload)).collect()
}

fn framed(kind: u8, payload: &[u8]) -> Vec<u8> {
    let mut buffer = PayloadBuf::default();
    buffer.extend(payload.iter().copied());
    encode_frame(kind, 0, &buffer).to_vec()
}

#[test]
#[expect(clippy::disallowed_methods, reason = "a board in real time")]
fn control_characters_of_a_board_never_reach_a_terminal() {
    let mut served = Served::new(&["--listen", "127.0.0.1:0"]);
    let address = served.address();
    let mut terminal = Terminal::open();
    std::os::unix::fs::symlink(&terminal.path, served.board()).unwrap();
    let mut client = Served::client(&address);
    client.ask("?WATCH;");
    std::thread::spawn(move || {
        for _ in 0..200 {
            terminal.write(&tricks());
            terminal.read();
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let device = std::iter::from_fn(|| client.next_line()).find(|line| !line["board"].is_null()).unwrap();
    assert_eq!((device["board"].as_str(), device["firmware"].as_str()), (Some("ev[2Jil"), Some("1]0;x")));
    let (_, hello) = served.daemon.line("board: ", SOON);
    assert!(hello.contains("ev[2Jil 1]0;x") && !hello.contains(char::is_control), "{hello:?}");
    let (_, said) = served.daemon.line("board says", SOON);
    assert!(said.ends_with("hel[31mloworld") && !said.contains(char::is_control), "{said:?}");
    served.daemon.end();
}
