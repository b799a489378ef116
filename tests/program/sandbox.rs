//! The service inside its sandbox: the unit's own lines become a namespace (by bubblewrap) and a system call filter, and slamd runs in it with a
//! board at its serial port. What slamd needs works, and what the unit forbids is refused.
//!
//! Needs Debian's `bubblewrap`, `systemd`, a C compiler's headers, `python3`, and a system that permits namespaces. Without them the test says
//! so; a missing package fails where the variable CI is set. As root it also changes the user and the owner of the port, as systemd and udev do.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod seccomp;
mod unit;

use slamd_capture::CaptureReader;
use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use unit::Unit;

const UNIT: &str = include_str!("../../configs/systemd/slamd.service");
const SOON: Duration = Duration::from_secs(30);

/// The host's side: what the sandbox shows of it, and what it must not.
struct Host {
    folder: tempfile::TempDir,
    notified: UnixDatagram,
    _board: Plugged,
}

impl Host {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let open = |path: &Path, mode: u32| {
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
        };
        open(folder.path(), 0o755);
        for name in ["state", "notify", "bin"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            open(&folder.path().join(name), 0o755);
        }
        std::fs::copy(env!("CARGO_BIN_EXE_slamd"), folder.path().join("bin/slamd")).unwrap();
        open(&folder.path().join("bin/slamd"), 0o755);
        std::fs::write(folder.path().join("secret"), "of another program").unwrap();
        open(&folder.path().join("secret"), 0o644);
        let notified = UnixDatagram::bind(folder.path().join("notify/socket")).unwrap();
        open(&folder.path().join("notify/socket"), 0o777);
        notified.set_read_timeout(Some(SOON)).unwrap();
        let board = Plugged::new(&folder.path().join("board"), Device::new(Board::robot(1), 1));
        Self { folder, notified, _board: board }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The board's end of the line, which takes the place of the device that the unit allows.
    fn port(&self) -> PathBuf {
        let port = std::fs::canonicalize(self.path("board")).unwrap();
        if unit::is_root() {
            let status = Command::new("chown").arg("root:dialout").arg(&port).status().unwrap();
            std::fs::set_permissions(&port, std::fs::Permissions::from_mode(0o660)).unwrap();
            assert!(status.success());
        }
        port
    }

    /// A command in the sandbox of a unit.
    fn inside(&self, unit: &Unit, command: &[&str]) -> Command {
        unit.sandbox(&unit::Places {
            state: &self.path("state"),
            notify: &self.path("notify"),
            programs: &self.path("bin"),
            filter: &self.path("filter"),
            port: &self.port(),
            command,
        })
    }

    /// The service, which records and opens every door.
    fn service(&self, unit: &Unit) -> Daemon {
        let words: Vec<&str> = unit.value("ExecStart").unwrap().split_whitespace().collect();
        let mut command = self.inside(unit, &words);
        command.args(["--record", "/var/lib/slamd/drives/", "--metrics", "127.0.0.1:9879"]);
        command.args(["--socket", "/var/lib/slamd/api.sock", "--listen", "127.0.0.1:9878"]);
        Daemon::run(command)
    }
}

const NOT_PERMITTED: &str = "namespaces are not permitted here";

/// Says why the tests cannot run here; none where they can.
fn hindrance() -> Option<String> {
    let works = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let mut bubble = Command::new("bwrap");
    bubble.args(["--unshare-user", "--unshare-net", "--unshare-pid", "--ro-bind", "/", "/", "--proc", "/proc", "true"]);
    let missing = if !works(Command::new("bwrap").arg("--version")) {
        "bwrap cannot be run; Debian's package is bubblewrap"
    } else if !works(&mut bubble) {
        NOT_PERMITTED
    } else if !works(Command::new("systemd-analyze").args(["syscall-filter", "@system-service"])) {
        "systemd-analyze cannot be run; Debian's package is systemd"
    } else if !works(Command::new("python3").arg("--version")) {
        "python3 cannot be run"
    } else {
        return None;
    };
    // Packages can be installed; what a container permits is not the test's to change.
    assert!(std::env::var_os("CI").is_none() || missing == NOT_PERMITTED, "{missing}");
    println!("not tested: {missing}");
    Some(missing.into())
}

/// A process below another one, by its program's name.
fn below(parent: u32, name: &str) -> Option<u32> {
    let children = std::fs::read_to_string(format!("/proc/{parent}/task/{parent}/children")).ok()?;
    children.split_whitespace().filter_map(|id| id.parse().ok()).find_map(|id: u32| {
        let own = std::fs::read_to_string(format!("/proc/{id}/comm")).unwrap_or_default();
        if own.trim() == name { Some(id) } else { below(id, name) }
    })
}

fn first_line(mut stream: impl std::io::Read) -> String {
    let mut line = String::new();
    BufReader::new(&mut stream).read_line(&mut line).unwrap();
    line
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the service records for some seconds")]
fn the_service_works_inside_its_sandbox() {
    if hindrance().is_some() {
        return;
    }
    let (host, unit) = (Host::new(), Unit::read(UNIT));
    let mut daemon = host.service(&unit);
    daemon.expect("link: streaming", SOON);
    daemon.expect("poses and map begin", SOON);
    let id = below(daemon.pid(), "slamd").expect("slamd runs below bubblewrap");
    // What the unit sets for every process of the service.
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let field = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':')).unwrap();
        line.trim().to_owned()
    };
    assert_eq!(field("NoNewPrivs"), "1");
    assert_eq!(field("CapBnd"), "0000000000000000");
    assert_eq!(field("Umask"), unit.value("UMask").unwrap());
    assert_eq!(field("Seccomp"), "2", "the filter of system calls is in force");
    assert!(field("Threads").parse::<u32>().unwrap() < unit.value("TasksMax").unwrap().parse::<u32>().unwrap());
    let peak_mib = field("VmHWM").split(' ').next().unwrap().parse::<u64>().unwrap() >> 10;
    let limit: u64 = unit.value("MemoryMax").unwrap().trim_end_matches('M').parse().unwrap();
    assert!(peak_mib < limit / 2, "{peak_mib} of {limit} MiB");
    // The manager hears of it.
    let mut message = [0; 4096];
    let length = host.notified.recv(&mut message).unwrap();
    assert!(message[..length].starts_with(b"READY=1"));
    // The owner's socket, from outside; both ports, from inside: nobody else reaches them.
    let stream = UnixStream::connect(host.path("state/slamd/api.sock")).unwrap();
    assert!(first_line(stream).contains("VERSION"));
    let health = within(id, "exec 3<>/dev/tcp/127.0.0.1/9879; printf 'GET /healthz HTTP/1.0\\r\\n\\r\\n' >&3; cat <&3");
    assert!(health.starts_with("HTTP/1.1 200") && health.contains("streaming"), "{health}");
    let api = within(id, "exec 3<>/dev/tcp/127.0.0.1/9878; head -n 1 <&3");
    assert!(api.contains("VERSION"), "{api}");
    assert!(TcpStream::connect("127.0.0.1:9879").is_err(), "the service's network is its own");
    std::thread::sleep(Duration::from_secs(5));
    let signal = Command::new("kill").args(["-s", "TERM", &id.to_string()]).status().unwrap();
    assert!(signal.success());
    daemon.wait();
    let state = host.path("state/slamd");
    for file in ["home.session", "out/map.png", "out/summary.json"] {
        assert!(state.join(file).metadata().unwrap().len() > 0, "{file}");
    }
    let drives: Vec<_> = std::fs::read_dir(state.join("drives")).unwrap().map(|it| it.unwrap().path()).collect();
    assert_eq!(drives.len(), 1);
    let records = CaptureReader::open(&drives[0]).unwrap().map(Result::unwrap).count();
    assert!(records > 100, "{records}");
    // The next start resumes the session.
    let mut again = host.service(&unit);
    again.expect("poses and map begin after 0 s", SOON);
    let id = below(again.pid(), "slamd").unwrap();
    assert!(Command::new("kill").args(["-s", "TERM", &id.to_string()]).status().unwrap().success());
    again.wait();
}

/// A bash script in the network of a process.
fn within(id: u32, script: &str) -> String {
    let mut command = Command::new("nsenter");
    command.args(["--preserve-credentials", "--user", "--net", "--target", &id.to_string(), "bash", "-c", script]);
    let output = command.output().unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn what_the_unit_forbids_to_the_service_stops_it() {
    if hindrance().is_some() {
        return;
    }
    let broken = |from: &str, to: &str, words: &str| {
        assert!(UNIT.contains(from), "{from}");
        let host = Host::new();
        let mut daemon = host.service(&Unit::read(&UNIT.replace(from, to)));
        daemon.expect(words, SOON);
    };
    broken("DeviceAllow=char-ttyUSB rw\n", "", "port missing");
    broken("StateDirectory=slamd\n", "", "/var/lib/slamd");
    broken("SystemCallFilter=~@privileged", "SystemCallFilter=~@privileged bind", "9878");
    broken("RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6", "RestrictAddressFamilies=AF_UNIX", "9878");
    if unit::is_root() {
        broken("SupplementaryGroups=dialout\n", "", "ermission denied");
    }
}

/// What a program tries, by name. Each prints its name if it is refused.
const TRIES: &str = r#"
refused() { name=$1; shift; "$@" >/dev/null 2>&1 </dev/null || echo "$name"; }
py() { python3 -c "$1"; }
refused etc touch /etc/slamd-probe
refused usr touch /usr/slamd-probe
refused root touch /slamd-probe
refused var touch /var/lib/slamd-probe
refused run touch /run/slamd-probe
refused home ls /home
refused roots-home ls /root
refused shadow cat /etc/shadow
refused others-files cat "$SECRET"
refused others-processes kill -0 "$OTHER"
refused disk sh -c 'ls /dev/vda || ls /dev/sda || ls /dev/nvme0n1'
refused console head -c 1 /dev/kmsg
refused network bash -c "exec 3<>/dev/tcp/127.0.0.1/$LISTENS"
refused setuid sh -c 'touch /var/lib/slamd/x; chmod 4755 /var/lib/slamd/x'
refused namespace unshare --user true
refused mount mount -t tmpfs none /var/lib/slamd
refused realtime chrt -f 1 true
refused clock date -s 2020-01-01
refused hostname hostname elsewhere
refused netlink py 'import socket; socket.socket(socket.AF_NETLINK, socket.SOCK_RAW)'
refused packet py 'import socket; socket.socket(socket.AF_PACKET, socket.SOCK_RAW)'
refused write-and-execute py 'import mmap; mmap.mmap(-1, 4096, prot=7)'
refused kernel-setting sh -c 'echo 1 > /proc/sys/kernel/panic'
refused WRONGLY-state touch /var/lib/slamd/probe
refused WRONGLY-tmp touch /tmp/probe
refused WRONGLY-inet py 'import socket; socket.create_server(("127.0.0.1", 0))'
refused WRONGLY-port sh -c 'stty -F /dev/ttyUSB0'
echo end
"#;

#[test]
fn what_the_unit_forbids_is_refused() {
    if hindrance().is_some() {
        return;
    }
    let host = Host::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let refused = |text: &str| -> Vec<String> {
        let mut command = host.inside(&Unit::read(text), &["bash", "-s"]);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let script = format!(
            "SECRET={}\nOTHER={}\nLISTENS={}\n{TRIES}",
            host.path("secret").display(),
            std::process::id(),
            listener.local_addr().unwrap().port()
        );
        child.stdin.take().unwrap().write_all(script.as_bytes()).unwrap();
        let (mut told, mut errors) = (String::new(), String::new());
        child.stdout.take().unwrap().read_to_string(&mut told).unwrap();
        child.stderr.take().unwrap().read_to_string(&mut errors).unwrap();
        child.wait().unwrap();
        let mut names: Vec<String> = told.lines().map(Into::into).collect();
        assert_eq!(names.pop().as_deref(), Some("end"), "{errors}");
        names
    };
    let all: Vec<&str> = TRIES.lines().filter_map(|line| line.strip_prefix("refused ")?.split(' ').next()).collect();
    let wanted: Vec<&str> = all.iter().copied().filter(|name| !name.starts_with("WRONGLY")).collect();
    assert_eq!(refused(UNIT), wanted);
    // With each of these lines gone, what it forbade is possible.
    let without = |keys: &[&str]| -> String {
        let is_of = |line: &&str| !keys.iter().any(|key| line.starts_with(&format!("{key}=")));
        UNIT.lines().filter(is_of).fold(String::new(), |text, line| text + line + "\n")
    };
    for (keys, name) in [
        (&["PrivateTmp"][..], "others-files"),
        (&["PrivateNetwork"], "network"),
        (&["RestrictSUIDSGID"], "setuid"),
        (&["RestrictAddressFamilies"], "netlink"),
        (&["MemoryDenyWriteExecute"], "write-and-execute"),
        (&["RestrictNamespaces", "SystemCallFilter"], "namespace"),
    ] {
        assert!(!refused(&without(keys)).iter().any(|it| it == name), "{name} is refused without {keys:?}");
    }
}
