//! The offline union: the site's map from captures alone, as a hub that has lost nothing makes it.

use crate::failure::{Failure, Kind};
use crate::fleet_file::FleetFile;
use crate::hub::replica::{csv_head, csv_line};
use crate::map_files;
use crate::merge::Newest;
use crate::name::Name;
use crate::player::{PlayError, Player, Report};
use crate::site::Site;
use slamd_files::private::create_folder;
use slamd_files::write_file;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// Merges the captures in `captures/ROBOT/*.mcap` and writes the map, and each drive's poses as `ROBOT-SESSION.poses.csv`.
///
/// # Errors
/// Where a folder or a capture cannot be read, or the results cannot be written.
pub fn union(captures: &Path, fleet: &FleetFile, out: &Path) -> Result<Site, Failure> {
    create_folder(out).map_err(|error| Failure::new(Kind::CantCreate, format!("{}: {error}", out.display())))?;
    let mut newest = Newest::default();
    for robot in fleet.robots().keys() {
        for path in mcap_files(&captures.join(robot.as_ref())).map_err(|error| unreadable(captures, &error))? {
            play(robot, &path, out, &mut newest)?;
        }
    }
    let site = Site::assemble(fleet, &newest);
    let sha256 = map_files::write(out, &site)?;
    for (robot, place) in &site.places {
        tracing::info!("{robot}: {place}");
    }
    tracing::info!("{}: SHA-256 {sha256}", out.join("merged.map").display());
    Ok(site)
}

fn play(robot: &Name, path: &Path, out: &Path, newest: &mut Newest) -> Result<(), Failure> {
    let failure = |error: PlayError| -> Failure {
        match error {
            PlayError::Capture(error) => error.into(),
            other => Failure::new(Kind::Data, format!("{}: {other}", path.display())),
        }
    };
    let file = File::open(path).map_err(|error| unreadable(path, &error))?;
    let mut player = Player::begin(BufReader::new(file), path).map_err(failure)?;
    let mut poses = csv_head();
    let played = player.finish(|report| {
        if let Report::Pose(pose) = report {
            csv_line(&mut poses, &pose);
        }
    });
    played.map_err(failure)?;
    if let Some(damage) = player.damage() {
        tracing::warn!("{}: {damage}", path.display());
    }
    if let Some(grid) = player.grid() {
        newest.take(robot, grid);
    }
    write_file(out, &format!("{robot}-{}.poses.csv", player.session()), poses.as_bytes())?;
    Ok(())
}

/// The captures of a robot, by name; none where it has no folder.
fn mcap_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "mcap"));
    files.sort();
    Ok(files)
}

fn unreadable(path: &Path, error: &io::Error) -> Failure {
    Failure::new(Kind::NoInput, format!("{}: {error}; name a folder that holds ROBOT/*.mcap", path.display()))
}
