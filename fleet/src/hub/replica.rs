//! Plays a drive on the hub from the growing copy of its capture. So data lost on the network is
//! recovered.

use super::Update;
use super::copy::{Files, digest};
use crate::clock::{Moment, wait};
use crate::follow::{Follow, Grip};
use crate::map_files::hex;
use crate::name::Name;
use crate::player::{PlayError, Player, Report};
use crate::session::SessionId;
use crate::wire::{Grid, Pose};
use sha2::Digest as _;
use std::fmt::Write as _;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::Duration;

/// A drive being played.
#[derive(Debug)]
pub struct Replica {
    grip: Grip,
    is_abandoned: Arc<AtomicBool>,
}

/// The result of a complete drive, played to its end.
#[derive(Clone, Debug)]
pub struct Played {
    /// The session.
    pub session: SessionId,
    /// Bytes of the capture.
    pub bytes: u64,
    /// SHA-256 of the file on disk, in hexadecimal.
    pub sha256: String,
    /// The numbers of all poses.
    pub poses: Vec<u64>,
    /// The numbers of all sweeps.
    pub sweeps: Vec<u64>,
    /// The poses as a file.
    pub poses_csv: String,
    /// The last map; `None` without a pose.
    pub map: Option<Grid>,
}

/// Minimum time between two maps.
const MAP_EVERY: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(20);

impl Replica {
    /// Starts a thread that plays a copy, complete or not.
    #[must_use]
    pub fn begin(robot: &Name, files: &Files, updates: &Sender<Update>) -> Self {
        let replica = Self { grip: Grip::default(), is_abandoned: Arc::default() };
        let (grip, is_abandoned) = (replica.grip.clone(), Arc::clone(&replica.is_abandoned));
        let (robot, files, updates) = (robot.clone(), files.clone(), updates.clone());
        std::thread::spawn(move || {
            let tell = |item: Update| {
                if !is_abandoned.load(Ordering::Acquire) {
                    // Sending fails only when the hub is ending.
                    let _ = updates.send(item);
                }
            };
            match play(&files, &grip, |grid| tell(Update::Map(robot.clone(), grid))) {
                Ok(played) => tell(Update::Played(robot.clone(), Box::new(played))),
                Err(error) => tell(Update::Trouble(robot.clone(), error.to_string())),
            }
        });
        replica
    }

    /// Marks the copy as complete.
    pub fn end(&self) {
        self.grip.end();
    }

    /// Discards a wrong copy: it sends no further updates.
    pub fn abandon(self) {
        self.is_abandoned.store(true, Ordering::Release);
        self.grip.end();
    }
}

fn play(files: &Files, grip: &Grip, each_map: impl Fn(Grid)) -> Result<Played, PlayError> {
    let path = if files.capture().exists() { files.capture() } else { files.part() };
    let io = |path: &Path, source| slamd_capture::CaptureError::Io { path: path.into(), source };
    let mut player = Player::begin(Follow::open(&path, grip.clone()).map_err(|error| io(&path, error))?, &path)?;
    let (mut poses, mut sweeps, mut poses_csv) = (Vec::new(), Vec::new(), csv_head());
    let mut told = Moment::now();
    loop {
        let goes_on = player.step(|report| match report {
            Report::Pose(pose) => {
                poses.push(pose.seq);
                csv_line(&mut poses_csv, &pose);
            }
            Report::Sweep(sweep) => sweeps.push(sweep.seq),
        })?;
        if !goes_on {
            break;
        }
        if told.elapsed() >= MAP_EVERY {
            told = Moment::now();
            player.grid().into_iter().for_each(&each_map);
        }
    }
    let map = player.grid();
    map.iter().cloned().for_each(&each_map);
    // The recording's end arrives just before the robot declares the file's end.
    while !grip.is_over() {
        wait(LOOK);
    }
    let whole = files.capture();
    let (bytes, sha256) =
        File::open(&whole).and_then(|mut file| digest(&mut file)).map_err(|error| io(&whole, error))?;
    let (session, sha256) = (player.session(), hex(&sha256.finalize()));
    Ok(Played { session, bytes, sha256, poses, sweeps, poses_csv, map })
}

/// The first line of a file of poses.
#[must_use]
pub fn csv_head() -> String {
    "seq,time_us,x_m,y_m,theta_rad\n".into()
}

/// Appends one pose with all significant digits.
pub fn csv_line(csv: &mut String, pose: &Pose) {
    let Pose { seq, time_us, x_m, y_m, theta_rad, .. } = pose;
    // Writing to a String cannot fail.
    let _ = writeln!(csv, "{seq},{time_us},{x_m},{y_m},{theta_rad}");
}
