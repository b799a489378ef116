//! Debian's broker and its client, for as long as a test needs them.

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A broker on this machine that remembers nothing when it ends.
pub struct Mosquitto {
    process: Child,
    port: u16,
    _folder: tempfile::TempDir,
}

impl Mosquitto {
    /// A broker that lets everybody in, at a port of its own or this one.
    pub fn start(port: Option<u16>) -> Self {
        Self::configured(port, |_| "allow_anonymous true\n".into())
    }

    /// A broker that lets in this user alone.
    pub fn with_password(user: &str, password: &str) -> Self {
        Self::configured(None, |folder| {
            let file = folder.join("users");
            let made = Command::new("mosquitto_passwd").arg("-b").arg("-c").arg(&file).args([user, password]).status();
            assert!(made.expect("Debian's package mosquitto").success());
            format!("allow_anonymous false\npassword_file {}\n", file.display())
        })
    }

    #[expect(clippy::disallowed_methods, reason = "the broker is there when it is there")]
    fn configured(port: Option<u16>, access: impl FnOnce(&Path) -> String) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let port = port.unwrap_or_else(|| TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port());
        let text = format!("listener {port} 127.0.0.1\npersistence false\nuser root\n{}", access(folder.path()));
        let file = folder.path().join("mosquitto.conf");
        std::fs::write(&file, text).unwrap();
        // Debian has it where only administrators look.
        let program = ["/usr/sbin/mosquitto", "mosquitto"].into_iter().find(|name| Path::new(name).exists());
        let mut command = Command::new(program.unwrap_or("mosquitto"));
        let process = command.arg("-c").arg(&file).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let process = process.expect("Debian's package mosquitto");
        let end = Instant::now() + Duration::from_secs(20);
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(Instant::now() < end, "no broker at port {port}");
            std::thread::sleep(Duration::from_millis(10));
        }
        Self { process, port, _folder: folder }
    }

    pub fn port(&self) -> u16 {
        self.port
    }

    /// As `--mqtt` takes it.
    pub fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// `mosquitto_sub` for all topics.
pub struct Subscriber {
    process: Child,
    lines: Receiver<String>,
    /// The last message of each topic.
    pub told: BTreeMap<String, Vec<u8>>,
    /// The same, of messages from before it subscribed.
    pub retained: BTreeMap<String, Vec<u8>>,
}

impl Subscriber {
    pub fn new(broker: &Mosquitto, login: Option<(&str, &str)>) -> Self {
        let mut command = Command::new("mosquitto_sub");
        command.args(["-h", "127.0.0.1", "-p", &broker.port.to_string(), "-t", "#", "-F", "%r %t %x"]);
        if let Some((user, password)) = login {
            command.args(["-u", user, "-P", password]);
        }
        let process = command.stdout(Stdio::piped()).spawn();
        let mut process = process.expect("Debian's package mosquitto-clients");
        let stdout = BufReader::new(process.stdout.take().unwrap());
        let (sender, lines) = channel();
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { process, lines, told: BTreeMap::new(), retained: BTreeMap::new() }
    }

    /// Listens until the messages so far are enough.
    ///
    /// # Panics
    /// Where that does not happen in time.
    #[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
    pub fn until(&mut self, within: Duration, is_enough: impl Fn(&Self) -> bool) {
        let end = Instant::now() + within;
        while !is_enough(self) {
            let Ok(line) = self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) else {
                panic!("not told within {within:?}; topics: {:?}", self.told.keys());
            };
            let mut words = line.split(' ');
            let [retained, topic, hex] = std::array::from_fn(|_| words.next().unwrap());
            let digits: Vec<u8> = hex.bytes().collect();
            let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
            let payload: Vec<u8> = digits.chunks(2).map(byte).collect();
            if retained == "1" {
                self.retained.insert(topic.into(), payload.clone());
            }
            self.told.insert(topic.into(), payload);
        }
    }

    /// Listens until this is the newest word at a topic.
    pub fn expect(&mut self, topic: &str, payload: &[u8], within: Duration) {
        self.until(within, |it| it.told.get(topic).is_some_and(|told| told == payload));
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
