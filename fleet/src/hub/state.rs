//! The hub's state and its files. One thread owns it.

use super::copy::Files;
use super::fetch::Request;
use super::heard::{Heard, Kind as Put};
use super::replica::{Played, Replica};
use super::status::{RobotStatus, SessionSummary, SiteStatus};
use super::{Hub, Update};
use crate::clock::Moment;
use crate::map_files;
use crate::merge::Newest;
use crate::name::Name;
use crate::session::SessionId;
use crate::site::{Place, Site};
use crate::wire::{Grid, MAX_SESSIONS, Status};
use slamd_files::private::create_folder;
use slamd_files::write_file;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::mpsc::Sender;
use std::time::Duration;

/// The hub's state.
pub(super) struct HubState {
    hub: Hub,
    robots: BTreeMap<Name, RobotEntry>,
    newest: Newest,
    /// Robots whose newest map is not on disk yet.
    unsaved: BTreeSet<Name>,
    places: BTreeMap<Name, Place>,
    merged_sha256: String,
    published: Option<Moment>,
    /// True if the content of `status.json` has changed.
    is_changed: bool,
    /// True if a robot's map has changed.
    has_new_map: bool,
}

/// The hub's data of one robot.
#[derive(Default)]
struct RobotEntry {
    requests: Option<Sender<Request>>,
    heard: BTreeMap<SessionId, Heard>,
    status: RobotStatus,
}

/// Minimum time between two writes of the map.
const PUBLISH_EVERY: Duration = Duration::from_secs(2);
/// A robot's map is requested if it is this many records, some seconds, ahead of the hub's.
const AHEAD: u64 = 300;

impl HubState {
    /// Loads the data that an earlier hub left in the folder.
    pub(super) fn open(hub: &Hub, updates: &Sender<Update>) -> io::Result<Self> {
        create_folder(&hub.folder.join("maps"))?;
        let mut state = Self {
            hub: hub.clone(),
            robots: BTreeMap::new(),
            newest: Newest::default(),
            unsaved: BTreeSet::new(),
            places: BTreeMap::new(),
            merged_sha256: String::new(),
            published: None,
            is_changed: true,
            has_new_map: true,
        };
        for robot in hub.fleet.robots().keys() {
            create_folder(&hub.captures(robot))?;
            state.robots.insert(robot.clone(), RobotEntry::default());
            match fs::read(state.map_file(robot)) {
                Ok(bytes) => match Grid::decode(&bytes) {
                    Ok(grid) => drop(state.newest.take(robot, grid)),
                    // The robot sends it again.
                    Err(error) => tracing::warn!("{}: {error}", state.map_file(robot).display()),
                },
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
            state.play_unfinished(robot, updates)?;
        }
        Ok(state)
    }

    /// Sets the sender of a robot's requests.
    pub(super) fn fetch_by(&mut self, robot: &Name, requests: Sender<Request>) {
        if let Some(entry) = self.robots.get_mut(robot) {
            entry.requests = Some(requests);
        }
    }

    /// Handles an update.
    pub(super) fn take(&mut self, update: Update) -> io::Result<()> {
        match update {
            Update::Alive(robot, is_there) => {
                tracing::info!("{robot}: {}", if is_there { "is there" } else { "is gone" });
                self.entry(&robot, |entry| entry.status.online = is_there);
                self.is_changed = true;
            }
            Update::Status(robot, status) => self.status(&robot, &status),
            Update::Heard(robot, session, put, seq) => return self.heard(&robot, session, put, seq),
            Update::Fetched(robot, session, bytes) => self.entry(&robot, |entry| {
                if entry.status.session == Some(session) {
                    entry.status.fetched_bytes = bytes;
                }
            }),
            Update::Map(robot, grid) => {
                if self.hub.fleet.robots().contains_key(&robot) && self.newest.take(&robot, grid) {
                    self.unsaved.insert(robot);
                    self.has_new_map = true;
                }
            }
            Update::Played(robot, played) => return self.played(&robot, *played),
            Update::Trouble(robot, words) => tracing::warn!("{robot}: {words}"),
        }
        Ok(())
    }

    /// Writes the map and the status, if something has changed and the period is over.
    pub(super) fn publish_if_due(&mut self) -> io::Result<()> {
        let is_due = self.published.is_none_or(|last| last.elapsed() >= PUBLISH_EVERY);
        if !is_due || !(self.is_changed || self.has_new_map) {
            return Ok(());
        }
        if std::mem::take(&mut self.has_new_map) {
            self.merge()?;
        }
        (self.published, self.is_changed) = (Some(Moment::now()), false);
        let status = self.site_status();
        write_file(&self.hub.folder, "status.json", &status.to_json()).map_err(io::Error::other)?;
        Ok(())
    }

    /// Writes the robots' maps and the merged map, and logs changes of the maps' placement.
    fn merge(&mut self) -> io::Result<()> {
        self.save_maps()?;
        let site = Site::assemble(&self.hub.fleet, &self.newest);
        for (robot, place) in &site.places {
            let before = self.places.get(robot);
            // Changes of the score alone are not logged.
            if before.map(std::mem::discriminant) != Some(std::mem::discriminant(place)) {
                tracing::info!("{robot}: {place}");
            }
        }
        match map_files::write(&self.hub.folder, &site) {
            Ok(sha256) => self.merged_sha256 = sha256,
            Err(error) => tracing::error!("{error}"),
        }
        self.places = site.places;
        Ok(())
    }

    fn status(&mut self, robot: &Name, status: &Status) {
        if status.captures.len() > MAX_SESSIONS {
            return tracing::warn!(
                "{robot}: offers {} captures, and {MAX_SESSIONS} are looked at",
                status.captures.len()
            );
        }
        let known = self.newest.get(robot).map(|grid| (grid.session, grid.seq));
        let last = status.captures.last();
        let map = status.map_seq > 0
            && last.is_some_and(|last| {
                known.is_none_or(|known| known < (last.session, status.map_seq.saturating_sub(AHEAD)))
            });
        self.entry(robot, |entry| {
            entry.status.offered(status);
            if let Some(requests) = &entry.requests {
                // The thread ends only with the hub.
                let _ = requests.send(Request { captures: status.captures.clone(), map });
            }
        });
        self.is_changed = true;
    }

    fn heard(&mut self, robot: &Name, session: SessionId, put: Put, seq: u64) -> io::Result<()> {
        let path = Files::new(&self.hub.captures(robot), session).heard();
        let Some(entry) = self.robots.get_mut(robot) else { return Ok(()) };
        if !entry.heard.contains_key(&session) {
            if entry.heard.len() >= MAX_SESSIONS {
                return Ok(());
            }
            entry.heard.insert(session, Heard::open(&path)?);
        }
        entry.heard.get_mut(&session).map_or(Ok(()), |heard| heard.note(put, seq))
    }

    /// Handles a complete drive: writes all poses, counts the lost puts, and writes the summary last.
    fn played(&mut self, robot: &Name, played: Played) -> io::Result<()> {
        let folder = self.hub.captures(robot);
        let files = Files::new(&folder, played.session);
        let heard = Heard::open(&files.heard())?;
        if let Some(map) = played.map.filter(|map| self.newest.take(robot, map.clone())) {
            tracing::debug!("{robot}: its last map has {} tiles", map.tiles.len());
            self.unsaved.insert(robot.clone());
            self.has_new_map = true;
        }
        self.save_maps()?;
        let summary = SessionSummary {
            robot: robot.clone(),
            session: played.session,
            bytes: played.bytes,
            sha256: played.sha256,
            poses: played.poses.len(),
            poses_heard: heard.count(Put::Pose, &played.poses),
            sweeps: played.sweeps.len(),
            sweeps_heard: heard.count(Put::Sweep, &played.sweeps),
        };
        let [poses, last] = files.results();
        write_file(&folder, &poses, played.poses_csv.as_bytes()).map_err(io::Error::other)?;
        write_file(&folder, &last, &summary.to_json()).map_err(io::Error::other)?;
        tracing::info!("{summary}");
        self.entry(robot, |entry| entry.status.whole_captures += 1);
        self.is_changed = true;
        Ok(())
    }

    /// Plays captures that were complete when the hub was killed, but not played to the end.
    fn play_unfinished(&mut self, robot: &Name, updates: &Sender<Update>) -> io::Result<()> {
        let folder = self.hub.captures(robot);
        for entry in fs::read_dir(&folder)? {
            let name = entry?.file_name();
            let session = name.to_str().and_then(|name| name.strip_suffix(".mcap")?.parse().ok());
            let Some(files) = session.map(|session| Files::new(&folder, session)) else { continue };
            if files.is_done() {
                self.entry(robot, |entry| entry.status.whole_captures += 1);
            } else {
                Replica::begin(robot, &files, updates).end();
            }
        }
        Ok(())
    }

    fn save_maps(&mut self) -> io::Result<()> {
        for robot in std::mem::take(&mut self.unsaved) {
            if let Some(grid) = self.newest.get(&robot) {
                write_file(&self.hub.folder.join("maps"), &format!("{robot}.map"), &grid.encode())
                    .map_err(io::Error::other)?;
            }
        }
        Ok(())
    }

    fn site_status(&self) -> SiteStatus {
        let robots = self.robots.iter().map(|(robot, entry)| {
            let place = self.places.get(robot).unwrap_or(&Place::NoMap);
            (robot.clone(), RobotStatus { place: place.to_string(), ..entry.status.clone() })
        });
        SiteStatus { merged_sha256: self.merged_sha256.clone(), robots: robots.collect() }
    }

    fn map_file(&self, robot: &Name) -> PathBuf {
        self.hub.folder.join("maps").join(format!("{robot}.map"))
    }

    fn entry(&mut self, robot: &Name, change: impl FnOnce(&mut RobotEntry)) {
        if let Some(entry) = self.robots.get_mut(robot) {
            change(entry);
        }
    }
}
