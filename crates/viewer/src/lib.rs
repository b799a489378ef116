//! Shows a session in Rerun, live or in a recording.
//!
//! `session → Tap → Mailbox → (thread) RerunWriter → RecordingStream`
//!
//! The pipeline's thread queues small copies. A full queue drops and counts them. Each sink has its
//! own thread, stream and copy of the map. So late joiners receive the full map, and stalled viewers
//! never block mapping.

#![forbid(unsafe_code)]

mod chart;
mod choice;
mod door;
mod known;
mod launch;
mod layout;
mod log_layer;
mod mailbox;
mod rerun_writer;
mod shapes;
mod sink;
mod snapshot;
mod style;
mod tap;
mod trail;

pub use choice::{Choice, HERE};

pub use launch::{Installed, Opened, has_display};
pub use log_layer::LogLayer;
pub use sink::Identity;
pub use tap::Tap;

use choice::{reached, url};
use door::Door;
use mailbox::{Inbox, Mailbox, mailbox};
use slamd_core::Watcher;
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// The sinks of a session.
pub struct Viewer {
    identity: Identity,
    is_patient: bool,
    sinks: Vec<Sink>,
    serves: Option<SocketAddr>,
    /// The port that viewers connect to.
    door: Option<Door>,
    opened: Vec<Opened>,
}

struct Sink {
    name: String,
    mailbox: Mailbox,
    is_done: Receiver<()>,
}

/// Maximum time until a started server accepts connections.
const SERVER_START_TIMEOUT: Duration = Duration::from_secs(2);

impl Viewer {
    /// A viewer without sinks. If `is_patient`, a full queue makes the session wait instead of dropping
    /// updates: for a replay.
    #[must_use]
    pub fn new(identity: Identity, is_patient: bool) -> Self {
        Self { identity, is_patient, sinks: Vec::new(), serves: None, door: None, opened: Vec::new() }
    }

    /// Adds a sink that writes a recording.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn record(&mut self, path: &Path) -> Result<(), String> {
        let rec = self.identity.file(path).map_err(|error| format!("{}: {error}", path.display()))?;
        self.begin(path.display().to_string(), move |identity, inbox| drop(sink::draw(rec, identity, inbox)));
        Ok(())
    }

    /// Adds a sink that connects to a viewer as soon as it listens, and again after it was gone.
    pub fn connect(&mut self, url: &str, host: &str) {
        let (url, host) = (url.to_owned(), host.to_owned());
        self.begin(url.clone(), move |identity, inbox| sink::visit(&url, &host, identity, inbox));
    }

    /// Adds a server that viewers connect to. Logs a warning and returns false if the address is in
    /// use.
    pub fn serve(&mut self, address: SocketAddr) -> bool {
        if self.serves == Some(address) {
            return true;
        }
        let door = door::hidden_address().and_then(|behind| Ok((behind, Door::open(address, behind)?)));
        let opened = door.map_err(|error| error.to_string()).and_then(|(behind, door)| {
            let rec = self.identity.server(behind).map_err(|error| error.to_string())?;
            Ok((rec, door))
        });
        let (rec, door) = match opened {
            Ok(opened) => opened,
            Err(error) => {
                tracing::warn!(
                    "viewer: nothing is served at {address}: {error}; if a viewer listens there, use --viewer connect; \
                     for another port, use --viewer serve={}:PORT",
                    address.ip()
                );
                return false;
            }
        };
        // A finished replay is served until the process ends.
        let keeps = self.is_patient;
        self.begin(url(address), move |identity, inbox| {
            let rec = sink::draw(rec, identity, inbox);
            if keeps {
                std::mem::forget(rec);
            }
        });
        self.door = Some(door);
        self.serves = Some(address);
        tracing::info!("viewer: watch with `rerun {}`, or in a browser with --viewer web", url(address));
        true
    }

    /// Opens the installed viewer on our server.
    pub fn spawn(&mut self) {
        let Some(url) = self.served() else { return };
        let opened =
            Installed::find().map_or_else(|| Err(std::io::Error::other(NO_VIEWER)), |viewer| viewer.window(&url));
        if let Err(error) = opened {
            tracing::warn!("viewer: cannot open a window: {error}");
        }
    }

    /// Starts the installed viewer's web server on our server.
    pub fn web(&mut self) {
        let Some(url) = self.served() else { return };
        match Installed::find().map_or_else(|| Err(std::io::Error::other(NO_VIEWER)), |viewer| viewer.web(&url)) {
            Ok((opened, link, page)) => {
                self.door.iter().for_each(|door| door.let_in(page));
                self.opened.push(opened);
                tracing::info!("viewer: in a browser at {link}");
            }
            Err(error) => tracing::warn!("viewer: cannot start the web viewer: {error}"),
        }
    }

    /// The URL of the server. Waits until it accepts connections.
    #[expect(clippy::disallowed_methods, reason = "a server is up when it is up")]
    fn served(&self) -> Option<String> {
        let address = reached(self.serves?);
        let begin = Instant::now();
        while TcpStream::connect_timeout(&address, SERVER_START_TIMEOUT).is_err()
            && begin.elapsed() < SERVER_START_TIMEOUT
        {
            std::thread::sleep(Duration::from_millis(10));
        }
        Some(url(address))
    }

    /// The watcher that shows a session and the log on all sinks; `None` without sinks.
    #[must_use]
    pub fn watcher(&self) -> Option<Watcher> {
        let mut tap = self.tap()?;
        Some(Box::new(move |context, update| tap.see(context, update)))
    }

    /// Number of updates dropped so far, over all sinks.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.sinks.iter().map(|sink| sink.mailbox.dropped()).sum()
    }

    /// The tap behind [`Self::watcher`], for callers that wrap it; `None` without sinks.
    #[must_use]
    pub fn tap(&self) -> Option<Tap> {
        let mailboxes: Vec<Mailbox> = self.sinks.iter().map(|sink| sink.mailbox.clone()).collect();
        log_layer::read(mailboxes.clone());
        (!mailboxes.is_empty()).then(|| Tap::new(mailboxes))
    }

    /// True if a server runs, which may be of use after the session's end.
    #[must_use]
    pub fn serves(&self) -> bool {
        self.serves.is_some()
    }

    /// Ends all sinks after the session's end. Waits at most `patience` for all of them together.
    /// Dropping the result closes the web viewers.
    #[expect(clippy::disallowed_methods, reason = "the end of a process must not wait for a viewer")]
    pub fn finish(self, patience: Duration) -> Vec<Opened> {
        log_layer::read(Vec::new());
        let end = Instant::now() + patience;
        // Signal the end to all sinks before waiting for the first.
        let ending = self.sinks.into_iter().map(|sink| (sink.name, sink.mailbox.dropped(), sink.is_done));
        for (name, dropped, is_done) in ending.collect::<Vec<_>>() {
            let is_late = is_done.recv_timeout(end.saturating_duration_since(Instant::now())).is_err();
            if dropped > 0 {
                tracing::warn!("viewer: {name} was too slow: {dropped} sweeps and log lines were dropped");
            }
            if is_late {
                tracing::warn!("viewer: {name} did not receive the end of the session in time");
            }
        }
        // A finished replay is served until the process ends.
        if self.is_patient {
            std::mem::forget(self.door);
        }
        self.opened
    }

    fn begin(&mut self, name: String, run: impl FnOnce(&Identity, &Inbox) + Send + 'static) {
        let (mailbox, inbox) = mailbox(self.is_patient);
        let (done, is_done) = channel();
        let identity = self.identity.clone();
        let work = move || {
            run(&identity, &inbox);
            let _ = done.send(());
        };
        let thread = std::thread::Builder::new().name("viewer".into()).spawn(work);
        match thread {
            Ok(_) => self.sinks.push(Sink { name, mailbox, is_done }),
            Err(error) => tracing::warn!("viewer: {name}: {error}"),
        }
    }
}

/// In an environment of its own: Debian and Raspberry Pi OS refuse a bare `pip install` (PEP 668).
const NO_VIEWER: &str = "no `rerun` on the PATH; `python3 -m venv ~/rerun && ~/rerun/bin/pip install rerun-sdk==0.36.3` installs it; \
    then `PATH=~/rerun/bin:$PATH`";
