//! `--viewer`: who watches a session.

use super::{Failure, Kind};
use crate::source::session::Session;
use clap::Args;
use slamd_viewer::{Choice, HERE, Identity, Installed, Viewer, has_display};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Watching a robot.
#[derive(Debug, Args)]
pub(super) struct LiveViewerArgs {
    /// Show the session in Rerun, several at once if given several times: serve[=IP:PORT] for viewers that come, spawn a viewer,
    /// connect[=URL] to one that listens, web for browsers, FILE.rrd, or off. Without it `slamd --port` serves on 127.0.0.1:9877, and opens the
    /// installed viewer where there is a display; `slamd monitor` does not.
    #[arg(long, value_name = "WHERE")]
    viewer: Vec<Choice>,
    /// Let --viewer serve listen on other addresses than this machine's own. Rerun asks nobody who they are.
    #[arg(long)]
    expose_viewer: bool,
}

/// Watching a replay.
#[derive(Debug, Args)]
pub(super) struct ReplayViewerArgs {
    /// Show the session in Rerun, several at once if given several times: FILE.rrd, serve[=IP:PORT] for viewers that come (until Ctrl-C),
    /// spawn a viewer, connect[=URL] to one that listens, web for browsers, or off. Without it nothing is shown: a replay is over before
    /// anybody could look.
    #[arg(long, value_name = "WHERE")]
    viewer: Vec<Choice>,
    /// Let --viewer serve listen on other addresses than this machine's own. Rerun asks nobody who they are.
    #[arg(long)]
    expose_viewer: bool,
}

/// A session that is over waits for its viewers no longer than this; a recording that was replayed has all the time.
const LIVE_PATIENCE: Duration = Duration::from_millis(1_200);
const REPLAY_PATIENCE: Duration = Duration::from_secs(60);

/// Who watches, and for how long in the end.
pub(super) struct Watched {
    viewer: Viewer,
    patience: Duration,
}

impl LiveViewerArgs {
    /// Somebody watches on the terminal: nothing else is opened unless asked for.
    pub(super) fn off_by_default(&mut self) {
        if self.viewer.is_empty() {
            self.viewer.push(Choice::Off);
        }
    }

    pub(super) fn begin(&self, robot: &str, unix_zero_us: Option<u64>) -> Result<Watched, Failure> {
        let mut choices = self.viewer.clone();
        if choices.is_empty() {
            choices.push(Choice::Serve(HERE));
            if has_display() && Installed::find().is_some() {
                choices.push(Choice::Spawn);
            }
        }
        hidden(&choices, self.expose_viewer)?;
        begin(&choices, robot, unix_zero_us, false)
    }
}

impl ReplayViewerArgs {
    /// True where anybody is to watch.
    pub(super) fn is_any(&self) -> bool {
        self.viewer.iter().any(|choice| *choice != Choice::Off)
    }

    pub(super) fn begin(&self, capture: &str, unix_zero_us: Option<u64>) -> Result<Watched, Failure> {
        hidden(&self.viewer, self.expose_viewer)?;
        begin(&self.viewer, capture, unix_zero_us, true)
    }
}

impl Watched {
    /// Lets the viewers see the session.
    pub(super) fn watch(&self, session: &mut Session) {
        if let Some(watcher) = self.viewer.watcher() {
            session.watch(watcher);
        }
    }

    /// The session is gone; its last is shown. Where a replay is served, until somebody ends it.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let stays = self.patience == REPLAY_PATIENCE && self.viewer.serves();
        let opened = self.viewer.finish(self.patience);
        if stays {
            tracing::info!("viewer: the replay is over and stays to be looked at; Ctrl-C ends");
            let runtime = super::run::runtime()?;
            let _guard = runtime.enter();
            let mut shutdown = crate::daemon::Shutdown::new(None)?;
            runtime.block_on(shutdown.requested());
        }
        drop(opened);
        Ok(())
    }
}

/// Nobody is let in by mistake.
fn hidden(choices: &[Choice], is_exposed: bool) -> Result<(), Failure> {
    let open = choices.iter().find_map(|choice| match choice {
        Choice::Serve(address) if !address.ip().is_loopback() => Some(address),
        _ => None,
    });
    match open {
        Some(address) if !is_exposed => Err(Failure::new(
            Kind::Usage,
            format!(
                "--viewer serve={address} shows map and path to whoever reaches this machine's network, because Rerun knows no password: say \
                 --expose-viewer if that is meant, or serve on 127.0.0.1 and come through `ssh -L`"
            ),
        )),
        _ => Ok(()),
    }
}

#[expect(clippy::disallowed_methods, reason = "no two sessions are the same")]
fn begin(choices: &[Choice], name: &str, unix_zero_us: Option<u64>, is_replay: bool) -> Result<Watched, Failure> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let recording = format!("slamd-{}-{}", now.as_nanos(), std::process::id());
    let identity = Identity { recording, name: name.into(), unix_zero_us };
    let mut viewer = Viewer::new(identity, is_replay);
    let choices = if choices.contains(&Choice::Off) { &[] } else { choices };
    let serves = choices.iter().any(|choice| matches!(choice, Choice::Serve(_)));
    for choice in choices {
        match choice {
            Choice::File(path) => viewer.record(path).map_err(|error| Failure::new(Kind::CantCreate, error))?,
            Choice::Connect(url, host) => viewer.connect(url, host),
            Choice::Serve(address) => drop(viewer.serve(*address)),
            Choice::Spawn | Choice::Web | Choice::Off => {}
        }
    }
    // These need a server, whichever it is.
    let needs = choices.iter().any(|choice| matches!(choice, Choice::Spawn | Choice::Web));
    if needs && !serves {
        viewer.serve(HERE);
    }
    if choices.contains(&Choice::Spawn) {
        viewer.spawn();
    }
    if choices.contains(&Choice::Web) {
        viewer.web();
    }
    Ok(Watched { viewer, patience: if is_replay { REPLAY_PATIENCE } else { LIVE_PATIENCE } })
}
