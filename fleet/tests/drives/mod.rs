//! Simulated drives as captures.

#![allow(dead_code, reason = "each user takes what it needs")]

use slamd_capture::{CaptureInfo, CaptureWriter, Record};
use slamd_core::{Config, Point, Pose2};
use slamd_fleet::player::Player;
use slamd_fleet::wire::Grid;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drive {
    pub(crate) world: &'static str,
    pub(crate) seed: u64,
    pub(crate) seconds: f64,
    /// Where it begins; where the world says by default.
    pub(crate) at: Option<(f64, f64)>,
}

impl Drive {
    /// Writes the capture, and gives `world_from_robot` at the first sweep.
    pub(crate) fn write(&self, path: &Path) -> Pose2 {
        let mut world = World::named(self.world).unwrap();
        world.start_heading_rad = None;
        if let Some((x, y)) = self.at {
            world.start = Point::new(x, y);
            assert!(world.clearance(world.start) > 0.25, "{self:?} begins in a wall");
        }
        let simulation = Simulation::new(SimConfig::usual(world, self.seed, self.seconds, 32));
        let info = CaptureInfo {
            slamd_version: "test".into(),
            config_toml: Config::default().to_toml(),
            notes: format!("{self:?}"),
            ..CaptureInfo::default()
        };
        let mut capture = CaptureWriter::create(path, &info).unwrap();
        let mut start = None;
        for record in session(simulation) {
            if let Record::Truth { pose, .. } = record {
                start.get_or_insert(pose);
            }
            capture.record(&record).unwrap();
        }
        capture.finish().unwrap();
        start.unwrap()
    }

    /// The map of the drive, and `world_from_map`.
    pub(crate) fn map(&self) -> (Grid, Pose2) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let start = self.write(&path);
        let grid = play(&path);
        let world_from_map = start * grid.start.pose().inverse();
        (grid, world_from_map)
    }
}

/// The map of a capture.
pub(crate) fn play(path: &Path) -> Grid {
    let mut player = Player::begin(BufReader::new(File::open(path).unwrap()), path).unwrap();
    player.finish(drop).unwrap();
    assert_eq!(player.damage(), None);
    player.grid().unwrap()
}
