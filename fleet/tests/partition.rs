//! Three robots and a hub, each in a network namespace of its own: one robot's cable is cut, the hub is killed, and in the end nothing is missing.
//!
//! The short form takes less than a minute; `SLAMD_FLEET_LONG=1` cuts the cable for 30 s. It needs root and iproute2.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod drives;
mod town;

use drives::Drive;
use slamd_fleet::clock::{Moment, wait};
use slamd_fleet::fleet_file::FleetFile;
use slamd_fleet::hub::status::{SessionSummary, SiteStatus};
use slamd_fleet::union::union;
use std::fmt::Write as _;
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;
use town::Town;

/// Where a drive begins in the flat; where the world says by default.
type Beginning = Option<(f64, f64)>;

/// Name, seed and beginning.
const ROBOTS: [(&str, u64, Beginning); 3] =
    [("attic", 33, Some((8.5, 6.8))), ("hall", 32, Some((2.0, 4.9))), ("kitchen", 31, None)];

/// When what happens, seconds after the robots were started.
struct Plan {
    drive_s: f64,
    speed: &'static str,
    cut_s: u64,
    kill_s: u64,
    restart_s: u64,
    mend_s: u64,
    patience_s: u64,
}

const SHORT: Plan = Plan { drive_s: 150.0, speed: "8", cut_s: 4, kill_s: 6, restart_s: 8, mend_s: 11, patience_s: 50 };
const LONG: Plan =
    Plan { drive_s: 240.0, speed: "4", cut_s: 10, kill_s: 18, restart_s: 22, mend_s: 40, patience_s: 150 };

/// The files of a run.
struct Files(tempfile::TempDir);

impl Files {
    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.at(name).to_str().unwrap().into()
    }

    fn secret(&self, name: &str, text: &str) {
        fs::write(self.at(name), text).unwrap();
        fs::set_permissions(self.at(name), fs::Permissions::from_mode(0o600)).unwrap();
    }

    /// Captures, passwords and the fleet file. The attic's start is unknown.
    fn prepare(plan: &Plan) -> Self {
        let files = Self(tempfile::tempdir().unwrap());
        let (mut fleet, mut users) = (String::new(), String::new());
        for (robot, seed, at) in ROBOTS {
            fs::create_dir_all(files.at(&format!("driven/{robot}"))).unwrap();
            let drive = Drive { world: "flat", seed, seconds: plan.drive_s, at };
            let start = drive.write(&files.at(&format!("driven/{robot}/drive.mcap")));
            let (x, y, degrees) = (start.x_m, start.y_m, start.theta_rad.to_degrees());
            writeln!(fleet, "[robots.{robot}]").unwrap();
            if robot != "attic" {
                writeln!(fleet, "start = {{ x_m = {x:?}, y_m = {y:?}, heading_deg = {degrees:?} }}").unwrap();
            }
            let password = format!("{robot}-0123456789abcdef");
            files.secret(&format!("password-{robot}"), &password);
            writeln!(users, "{robot}:{password}").unwrap();
        }
        files.secret("users", &users);
        fs::write(files.at("fleet.toml"), fleet).unwrap();
        files
    }

    fn start_hub(&self, town: &mut Town) {
        let (fleet, out, users) = (self.text("fleet.toml"), self.text("site"), self.text("users"));
        let arguments = [
            "hub",
            "--site",
            "home",
            "--fleet",
            &fleet,
            "--out",
            &out,
            "--listen",
            "tcp/10.77.0.1:7447",
            "--users",
            &users,
        ];
        town.start("hub", &arguments, &self.at("hub.log"));
    }

    fn start_robot(&self, town: &mut Town, robot: &str, speed: &str) {
        let capture = self.text(&format!("driven/{robot}/drive.mcap"));
        let password = self.text(&format!("password-{robot}"));
        let who = ["robot", "--site", "home", "--name", robot, "--connect", "tcp/10.77.0.1:7447"];
        let what = ["--password-file", &password, "--speed", speed, "--capture", &capture];
        town.start(robot, &[&who[..], &what[..]].concat(), &self.at(&format!("{robot}.log")));
    }

    /// The summary of each robot's drive, once it is there.
    fn summaries(&self) -> Vec<SessionSummary> {
        let summary = |robot: &str| {
            let folder = fs::read_dir(self.at(&format!("site/captures/{robot}"))).ok()?;
            let paths = folder.map(|entry| entry.unwrap().path());
            let path = paths.into_iter().find(|path| path.extension().is_some_and(|extension| extension == "json"))?;
            Some(serde_json::from_slice(&fs::read(path).unwrap()).unwrap())
        };
        ROBOTS.iter().filter_map(|(robot, ..)| summary(robot)).collect()
    }

    fn logs(&self) -> String {
        let name = |robot: &str| format!("{robot}.log");
        let names = ROBOTS.iter().map(|(robot, ..)| name(robot)).chain([name("hub")]);
        names.map(|name| format!("--- {name}\n{}", fs::read_to_string(self.at(&name)).unwrap_or_default())).collect()
    }

    fn is_same(&self, name: &str, at: &Path) -> bool {
        matches!((fs::read(self.at("site").join(name)), fs::read(at)), (Ok(a), Ok(b)) if a == b)
    }
}

/// Lets everything happen, and waits until the hub has all of each drive.
fn happen(town: &mut Town, files: &Files, plan: &Plan) -> Vec<SessionSummary> {
    files.start_hub(town);
    wait(Duration::from_millis(500));
    ROBOTS.iter().for_each(|(robot, ..)| files.start_robot(town, robot, plan.speed));
    let begin = Moment::now();
    let until = |seconds: u64| wait(Duration::from_secs(seconds).saturating_sub(begin.elapsed()));
    until(plan.cut_s);
    town.cable("attic", false);
    until(plan.kill_s);
    town.kill("hub");
    until(plan.restart_s);
    files.start_hub(town);
    until(plan.mend_s);
    town.cable("attic", true);
    loop {
        let summaries = files.summaries();
        if summaries.len() == ROBOTS.len() {
            println!("everything was there {:.1} s after the start", begin.elapsed().as_secs_f64());
            return summaries;
        }
        if let Some(machine) = town.ended() {
            panic!("{machine} has ended\n{}", files.logs());
        }
        assert!(begin.elapsed().as_secs() < plan.patience_s, "not everything came\n{}", files.logs());
        wait(Duration::from_millis(100));
    }
}

#[test]
fn a_cut_cable_and_a_killed_hub_leave_nothing_missing() {
    let plan = if std::env::var_os("SLAMD_FLEET_LONG").is_some() { LONG } else { SHORT };
    let mut town = match Town::build(&["hub", "attic", "hall", "kitchen"]) {
        Ok(town) => town,
        Err(why) => {
            println!("SKIPPED, AND NOTHING WAS TESTED: network namespaces need root and iproute2: {why}");
            return;
        }
    };
    let files = Files::prepare(&plan);
    let fleet = FleetFile::read(&files.at("fleet.toml")).unwrap();
    let offline = files.at("offline");
    let site = union(&files.at("driven"), &fleet, &offline).unwrap();
    site.places.iter().for_each(|(robot, place)| println!("{robot}: {place}"));

    let summaries = happen(&mut town, &files, &plan);
    for summary in &summaries {
        println!("{summary}");
        let SessionSummary { robot, session, poses, poses_heard, .. } = summary;
        // Every capture is complete, and so is every pose.
        let copy = format!("captures/{robot}/{session}.mcap");
        assert!(files.is_same(&copy, &files.at(&format!("driven/{robot}/drive.mcap"))), "{copy}\n{}", files.logs());
        let poses_csv = format!("captures/{robot}/{session}.poses.csv");
        assert!(files.is_same(&poses_csv, &offline.join(format!("{robot}-{session}.poses.csv"))), "{poses_csv}");
        // The cut and the kill were felt, and not everything was lost: this test has tested something.
        let lost_at_least =
            if robot.as_ref() == "attic" { plan.mend_s - plan.cut_s } else { plan.restart_s - plan.kill_s };
        let rate = 10.0 * plan.speed.parse::<f64>().unwrap();
        assert!((poses - poses_heard) as f64 > 0.5 * rate * lost_at_least as f64, "{summary}");
        assert!(poses_heard * 10 > *poses, "{summary}\n{}", files.logs());
    }

    // The map on disk follows within seconds.
    let names = ["merged.map", "merged.pgm", "merged.yaml", "merged.png"];
    let begin = Moment::now();
    while !names.iter().all(|name| files.is_same(name, &offline.join(name))) {
        let differing: Vec<_> = names.iter().filter(|name| !files.is_same(name, &offline.join(name))).collect();
        assert!(begin.elapsed().as_secs() < 10, "{differing:?} differ from the offline union\n{}", files.logs());
        wait(Duration::from_millis(100));
    }
    let status: SiteStatus = serde_json::from_slice(&fs::read(files.at("site/status.json")).unwrap()).unwrap();
    for (robot, place) in &site.places {
        assert_eq!(status.robots[robot].place, place.to_string());
        assert!(status.robots[robot].online && status.robots[robot].whole_captures == 1, "{status:?}");
    }
    println!("the merged map is the offline union byte for byte: SHA-256 {}", status.merged_sha256);
}
