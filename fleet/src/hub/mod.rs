//! The hub: receives the robots' messages, fetches their captures, and maintains the site's map.
//!
//! All data is in one folder. Each file is complete or grows by verified pieces, so the hub can be
//! killed at any time and started again:
//!
//! | file | content |
//! |---|---|
//! | `captures/ROBOT/SESSION.mcap` | a complete capture; `.mcap.part` while it is fetched |
//! | `captures/ROBOT/SESSION.poses.csv` | all its poses |
//! | `captures/ROBOT/SESSION.heard` | its received puts |
//! | `captures/ROBOT/SESSION.json` | its length, SHA-256, and how many puts were lost and refilled |
//! | `maps/ROBOT.map` | the robot's newest map |
//! | `merged.map`, `.pgm`, `.yaml`, `.png` | the site's map: the sums, and images |
//! | `status.json` | the connected robots, and the pose of each robot's map |

pub mod copy;
pub mod fetch;
pub mod heard;
pub mod replica;
pub mod status;

mod state;

use crate::failure::{Failure, Kind};
use crate::fleet_file::FleetFile;
use crate::name::{Name, Topic, key};
use crate::network::{Endpoint, listen};
use crate::session::SessionId;
use crate::wire::{Grid, Pose, Status, Sweep, from_json};
use heard::Kind as Put;
use replica::Played;
use slamd_files::private::create_folder;
use state::HubState;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait as _};

/// News from a robot.
#[derive(Debug)]
pub enum Update {
    /// It connected (true) or disconnected.
    Alive(Name, bool),
    /// Its status.
    Status(Name, Status),
    /// A put was received.
    Heard(Name, SessionId, Put, u64),
    /// The number of fetched bytes of a capture.
    Fetched(Name, SessionId, u64),
    /// A map from it.
    Map(Name, Grid),
    /// A drive was fetched and played completely.
    Played(Name, Box<Played>),
    /// An error.
    Trouble(Name, String),
}

/// The hub's options.
#[derive(Clone, Debug)]
pub struct Hub {
    /// The site.
    pub site: Name,
    /// The fleet.
    pub fleet: FleetFile,
    /// The folder of all data.
    pub folder: PathBuf,
}

/// Maximum number of queued puts. Further ones are lost, and refilled from the capture.
const MAX_WAITING: usize = 10_000;
/// Maximum time between two checks whether to publish.
const PUBLISH_CHECK_PERIOD: Duration = Duration::from_millis(500);

impl Hub {
    /// Listens and runs until killed.
    ///
    /// # Errors
    /// When the folder or the address cannot be used, or robots could connect without a password.
    pub fn run(&self, at: &Endpoint, users: Option<&Path>) -> Result<(), Failure> {
        let (updates, heard) = channel();
        let mut state = HubState::open(self, &updates).map_err(|error| {
            let text = format!("{}: {error}; choose a folder that can be written with --out", self.folder.display());
            Failure::new(Kind::CantCreate, text)
        })?;
        let session = listen(at, &self.site, &self.fleet, users)?;
        let waiting = Arc::new(AtomicUsize::new(0));
        for robot in self.fleet.robots().keys() {
            self.listen_to(robot, &session, &updates, &waiting)
                .map_err(|error| Failure::new(Kind::Unavailable, error.to_string()))?;
            let folder = self.captures(robot);
            create_folder(&folder).map_err(|error| Failure::new(Kind::CantCreate, error.to_string()))?;
            state.fetch_by(robot, fetch::begin(&self.site, robot, folder, &session, &updates));
        }
        tracing::info!("site {}: listening, {} robots may come", self.site, self.fleet.robots().len());
        work(&mut state, &heard, &waiting)
    }

    fn captures(&self, robot: &Name) -> PathBuf {
        self.folder.join("captures").join(robot.as_ref())
    }

    /// Subscribes to a robot's puts and its liveliness.
    fn listen_to(
        &self,
        robot: &Name,
        session: &Session,
        updates: &Sender<Update>,
        waiting: &Arc<AtomicUsize>,
    ) -> zenoh::Result<()> {
        let (name, out, waiting) = (robot.clone(), updates.clone(), Arc::clone(waiting));
        let hear = move |sample: Sample| {
            let Some(item) = item(&name, &sample) else { return };
            if matches!(item, Update::Heard(..)) && waiting.fetch_add(1, Ordering::AcqRel) >= MAX_WAITING {
                waiting.fetch_sub(1, Ordering::AcqRel);
                return;
            }
            // Sending fails only when the hub is ending.
            let _ = out.send(item);
        };
        let every = format!("slamd/{}/{robot}/*", self.site);
        session.declare_subscriber(every).callback(hear).background().wait()?;
        let (name, out) = (robot.clone(), updates.clone());
        let notice = move |sample: Sample| {
            let _ = out.send(Update::Alive(name.clone(), sample.kind() == SampleKind::Put));
        };
        let alive = key(&self.site, robot, Topic::Alive);
        session.liveliness().declare_subscriber(alive).history(true).callback(notice).background().wait()
    }
}

/// Decodes a put; `None` for an unknown topic.
fn item(robot: &Name, sample: &Sample) -> Option<Update> {
    let payload = sample.payload().to_bytes();
    let topic = sample.key_expr().as_str().rsplit('/').next().unwrap_or_default();
    let read = if topic == Topic::Pose.word() {
        from_json::<Pose>(&payload).map(|pose| Update::Heard(robot.clone(), pose.session, Put::Pose, pose.seq))
    } else if topic == Topic::Sweep.word() {
        from_json::<Sweep>(&payload).map(|sweep| Update::Heard(robot.clone(), sweep.session, Put::Sweep, sweep.seq))
    } else if topic == Topic::Status.word() {
        from_json::<Status>(&payload).map(|status| Update::Status(robot.clone(), status))
    } else {
        return None;
    };
    Some(read.unwrap_or_else(|error| Update::Trouble(robot.clone(), format!("its {topic} {error}"))))
}

/// The hub's main loop.
fn work(state: &mut HubState, heard: &Receiver<Update>, waiting: &AtomicUsize) -> Result<(), Failure> {
    loop {
        match heard.recv_timeout(PUBLISH_CHECK_PERIOD) {
            Ok(item) => {
                if matches!(item, Update::Heard(..)) {
                    waiting.fetch_sub(1, Ordering::AcqRel);
                }
                state.take(item).map_err(writing)?;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        state.publish_if_due().map_err(writing)?;
    }
}

fn writing(error: std::io::Error) -> Failure {
    Failure::new(Kind::Io, format!("{error}; the hub can be started again when its folder can be written"))
}
