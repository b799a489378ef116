//! What the robot knows, in Rerun: live, or into a file.
//!
//! `session → Tap → Mailbox → (thread) RerunWriter → RecordingStream`
//!
//! The pipeline's thread copies what is small and goes on; a queue that is full drops, and counts. Each sink has its thread, its stream and
//! its own memory of the map, so that a viewer may come late, go away, hang or be none.

#![forbid(unsafe_code)]

mod chart;
mod choice;
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
use mailbox::{Inbox, Mailbox, mailbox};
use slamd_core::driver::Watcher;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// The sinks of a session.
pub struct Viewer {
    identity: Identity,
    is_patient: bool,
    sinks: Vec<Sink>,
    serves: Option<SocketAddr>,
    opened: Vec<Opened>,
}

struct Sink {
    name: String,
    mailbox: Mailbox,
    is_done: Receiver<()>,
}

/// A server is there within this.
const UP: Duration = Duration::from_secs(2);

impl Viewer {
    /// No sink yet. A patient viewer is for a session that can wait, such as a replay.
    #[must_use]
    pub fn new(identity: Identity, is_patient: bool) -> Self {
        Self { identity, is_patient, sinks: Vec::new(), serves: None, opened: Vec::new() }
    }

    /// Begins a recording.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn record(&mut self, path: &Path) -> Result<(), String> {
        let rec = self.identity.file(path).map_err(|error| format!("{}: {error}", path.display()))?;
        self.begin(path.display().to_string(), move |identity, inbox| drop(sink::draw(rec, identity, inbox)));
        Ok(())
    }

    /// Goes to a viewer that listens, now or later.
    pub fn connect(&mut self, url: &str, host: &str) {
        let (url, host) = (url.to_owned(), host.to_owned());
        self.begin(url.clone(), move |identity, inbox| sink::visit(&url, &host, identity, inbox));
    }

    /// Waits for viewers; they are told to look there. False, with a line that says why, where somebody else listens there.
    pub fn serve(&mut self, address: SocketAddr) -> bool {
        if self.serves == Some(address) {
            return true;
        }
        // Rerun would find out on another thread, where nobody hears of it.
        let free = TcpListener::bind(address).map(drop);
        let rec = free.map_err(|error| error.to_string());
        let rec = rec.and_then(|()| self.identity.server(address).map_err(|error| error.to_string()));
        let rec = match rec {
            Ok(rec) => rec,
            Err(error) => {
                tracing::warn!(
                    "viewer: nothing is served at {address}: {error}; a viewer that listens there is shown to with --viewer connect, \
                     --viewer serve={}:PORT takes another port",
                    address.ip()
                );
                return false;
            }
        };
        // What has been replayed is served until the process ends.
        let keeps = self.is_patient;
        self.begin(url(address), move |identity, inbox| {
            let rec = sink::draw(rec, identity, inbox);
            if keeps {
                std::mem::forget(rec);
            }
        });
        self.serves = Some(address);
        tracing::info!("viewer: watch with `rerun {}`, or in a browser with --viewer web", url(address));
        true
    }

    /// Opens the installed viewer on what is served.
    pub fn spawn(&mut self) {
        let Some(url) = self.served() else { return };
        let opened =
            Installed::find().map_or_else(|| Err(std::io::Error::other(NO_VIEWER)), |viewer| viewer.window(&url));
        if let Err(error) = opened {
            tracing::warn!("viewer: no window is opened: {error}");
        }
    }

    /// Lets the installed viewer serve itself to browsers.
    pub fn web(&mut self) {
        let Some(url) = self.served() else { return };
        match Installed::find().map_or_else(|| Err(std::io::Error::other(NO_VIEWER)), |viewer| viewer.web(&url)) {
            Ok((opened, link)) => {
                self.opened.push(opened);
                tracing::info!("viewer: in a browser at {link}");
            }
            Err(error) => tracing::warn!("viewer: no page is served: {error}"),
        }
    }

    /// The URL of the server, once it answers.
    #[expect(clippy::disallowed_methods, reason = "a server is up when it is up")]
    fn served(&self) -> Option<String> {
        let address = reached(self.serves?);
        let begin = Instant::now();
        while TcpStream::connect_timeout(&address, UP).is_err() && begin.elapsed() < UP {
            std::thread::sleep(Duration::from_millis(10));
        }
        Some(url(address))
    }

    /// What shows a session, and the log, to the sinks; none where there is no sink.
    #[must_use]
    pub fn watcher(&self) -> Option<Watcher> {
        let mut tap = self.tap()?;
        Some(Box::new(move |context, update| tap.see(context, update)))
    }

    /// What found no room so far, over all sinks.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.sinks.iter().map(|sink| sink.mailbox.dropped()).sum()
    }

    /// What sees a session, for somebody who wants to be in between; none where there is no sink.
    #[must_use]
    pub fn tap(&self) -> Option<Tap> {
        let mailboxes: Vec<Mailbox> = self.sinks.iter().map(|sink| sink.mailbox.clone()).collect();
        log_layer::read(mailboxes.clone());
        (!mailboxes.is_empty()).then(|| Tap::new(mailboxes))
    }

    /// True while something is served that a person may want to look at when the session is over.
    #[must_use]
    pub fn serves(&self) -> bool {
        self.serves.is_some()
    }

    /// Ends, when the session that was watched is gone. Waits no longer than `patience` for all sinks together. What was opened for
    /// browsers is closed when what this returns is dropped.
    #[expect(clippy::disallowed_methods, reason = "the end of a process must not wait for a viewer")]
    pub fn finish(self, patience: Duration) -> Vec<Opened> {
        log_layer::read(Vec::new());
        let end = Instant::now() + patience;
        // All are told before one is waited for.
        let ending = self.sinks.into_iter().map(|sink| (sink.name, sink.mailbox.dropped(), sink.is_done));
        for (name, dropped, is_done) in ending.collect::<Vec<_>>() {
            let is_late = is_done.recv_timeout(end.saturating_duration_since(Instant::now())).is_err();
            if dropped > 0 {
                tracing::warn!("viewer: {dropped} sweeps and lines are not shown at {name}: it was too slow");
            }
            if is_late {
                tracing::warn!("viewer: {name} did not take the last of it in time");
            }
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

const NO_VIEWER: &str = "no `rerun` on the PATH; `pip install rerun-sdk==0.36.3` installs it";
