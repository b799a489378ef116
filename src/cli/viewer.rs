//! `--viewer`: shows a session in Rerun.

use super::{Failure, Kind};
use crate::source::session::Session;
use clap::Args;
use slamd_files::OutputGuard;
use slamd_viewer::{Choice, HERE, Identity, Installed, Viewer, has_display};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Viewer options of a live session.
#[derive(Debug, Args)]
pub(super) struct LiveViewerArgs {
    /// Show the session in Rerun: serve[=IP:PORT] for viewers that connect, spawn a viewer, connect[=URL] to a running one, web for browsers,
    /// FILE.rrd, or off; may be repeated. By default `slamd --port` serves on 127.0.0.1:9877 and opens the installed viewer if there is a
    /// display; `slamd monitor` shows none.
    #[arg(long, value_name = "WHERE")]
    viewer: Vec<Choice>,
    /// Allow --viewer serve on addresses other than loopback. Rerun has no password.
    #[arg(long)]
    expose_viewer: bool,
}

/// Viewer options of a replay.
#[derive(Debug, Args)]
pub(super) struct ReplayViewerArgs {
    /// Show the session in Rerun: FILE.rrd, serve[=IP:PORT] for viewers that connect (until Ctrl-C), spawn a viewer, connect[=URL] to a running
    /// one, web for browsers, or off; may be repeated. By default nothing is shown, because a replay ends within seconds.
    #[arg(long, value_name = "WHERE")]
    viewer: Vec<Choice>,
    /// Allow --viewer serve on addresses other than loopback. Rerun has no password.
    #[arg(long)]
    expose_viewer: bool,
}

/// How long the end of a session waits for its viewers: short for a robot, long for a replay.
const LIVE_TIMEOUT: Duration = Duration::from_millis(1_200);
const REPLAY_TIMEOUT: Duration = Duration::from_secs(60);

/// The viewers, and how long the end waits for them.
pub(super) struct Watched {
    viewer: Viewer,
    timeout: Duration,
}

impl LiveViewerArgs {
    /// Shows no viewer unless the user asked for one.
    pub(super) fn off_by_default(&mut self) {
        if self.viewer.is_empty() {
            self.viewer.push(Choice::Off);
        }
    }

    pub(super) fn begin(
        &self,
        robot: &str,
        unix_zero_us: Option<u64>,
        guard: &OutputGuard,
    ) -> Result<Watched, Failure> {
        let mut choices = self.viewer.clone();
        if choices.is_empty() {
            choices.push(Choice::Serve(HERE));
            if has_display() && Installed::find().is_some() {
                choices.push(Choice::Spawn);
            }
        }
        check_exposure(&choices, self.expose_viewer)?;
        begin(&choices, robot, unix_zero_us, false, guard)
    }
}

impl ReplayViewerArgs {
    /// True if a viewer is requested.
    pub(super) fn is_any(&self) -> bool {
        self.viewer.iter().any(|choice| *choice != Choice::Off)
    }

    pub(super) fn begin(
        &self,
        capture: &str,
        unix_zero_us: Option<u64>,
        guard: &OutputGuard,
    ) -> Result<Watched, Failure> {
        check_exposure(&self.viewer, self.expose_viewer)?;
        begin(&self.viewer, capture, unix_zero_us, true, guard)
    }
}

impl Watched {
    /// Adds the viewers to the session.
    pub(super) fn watch(&self, session: &mut Session) {
        if let Some(watcher) = self.viewer.watcher() {
            session.watch(watcher);
        }
    }

    /// Shows the end of the session. A served replay stays open until Ctrl-C.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let stays = self.timeout == REPLAY_TIMEOUT && self.viewer.serves();
        let opened = self.viewer.finish(self.timeout);
        if stays {
            tracing::info!("viewer: the replay has ended and is still served; Ctrl-C ends");
            let runtime = super::run::runtime()?;
            let _guard = runtime.enter();
            let mut shutdown = crate::daemon::Shutdown::new(None)?;
            runtime.block_on(shutdown.requested());
        }
        drop(opened);
        Ok(())
    }
}

/// Rejects an address other than loopback without `--expose-viewer`.
fn check_exposure(choices: &[Choice], is_exposed: bool) -> Result<(), Failure> {
    let open = choices.iter().find_map(|choice| match choice {
        Choice::Serve(address) if !address.ip().is_loopback() => Some(address),
        _ => None,
    });
    match open {
        Some(address) if !is_exposed => Err(Failure::new(
            Kind::Usage,
            format!(
                "--viewer serve={address} shows map and path to everyone in this machine's network, because Rerun has no password: add \
                 --expose-viewer if that is intended, or serve on 127.0.0.1 and connect through `ssh -L`"
            ),
        )),
        _ => Ok(()),
    }
}

#[expect(clippy::disallowed_methods, reason = "makes the recording's id unique")]
fn begin(
    choices: &[Choice],
    name: &str,
    unix_zero_us: Option<u64>,
    is_replay: bool,
    guard: &OutputGuard,
) -> Result<Watched, Failure> {
    let mut guard = guard.clone();
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let recording = format!("slamd-{}-{}", now.as_nanos(), std::process::id());
    let identity = Identity { recording, name: name.into(), unix_zero_us };
    let mut viewer = Viewer::new(identity, is_replay);
    let choices = if choices.contains(&Choice::Off) { &[] } else { choices };
    let serves = choices.iter().any(|choice| matches!(choice, Choice::Serve(_)));
    for choice in choices {
        match choice {
            Choice::File(path) => {
                guard.output(path)?;
                viewer.record(path).map_err(|error| Failure::new(Kind::CantCreate, error))?;
            }
            Choice::Connect(url, host) => viewer.connect(url, host),
            Choice::Serve(address) => drop(viewer.serve(*address)),
            Choice::Spawn | Choice::Web | Choice::Off => {}
        }
    }
    // These two need a server on any address.
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
    Ok(Watched { viewer, timeout: if is_replay { REPLAY_TIMEOUT } else { LIVE_TIMEOUT } })
}
