//! `slamd export FILE`

use super::outputs::ForceArg;
use super::replay::open;
use super::state_args::StateArgs;
use super::{Failure, HowArgs, Kind, terminal};
use crate::source::replay::step;
use crate::source::session::Session;
use clap::{ArgGroup, Args};
use slamd_capture::CaptureReader;
use slamd_core::{Event, Update};
use slamd_export::{Bag, BagError};
use slamd_files::{Output, OutputGuard};
use slamd_publish::{Outputs, PoseTable, Source, Trajectory};
use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

const EXAMPLES: &str = "Examples:
  slamd export drive.mcap --mcap bag.mcap   for `ros2 bag play` and Foxglove
  slamd export drive.mcap --csv poses.csv --tum poses.tum
  slamd export drive.mcap --svg plan.svg    a floor plan to print to scale

docs/export.md has topics, frames, rates and units. Maps for map_server come
from `slamd replay`.";

/// Export a capture for other programs: as a ROS 2 bag, which Foxglove opens too, as a table of poses, or as a floor plan.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, group(ArgGroup::new("wanted").required(true).multiple(true)))]
pub(super) struct ExportArgs {
    /// A capture (MCAP): recorded with --record, simulated or imported. The export replays it.
    file: PathBuf,
    /// Write map, poses, transforms, ranges and diagnostics to this ROS 2 bag (MCAP).
    #[arg(long, value_name = "FILE", group = "wanted")]
    mcap: Option<PathBuf>,
    /// Write the poses with their variances to this CSV file.
    #[arg(long, value_name = "FILE", group = "wanted")]
    csv: Option<PathBuf>,
    /// Write the poses to this file in the TUM benchmark's format.
    #[arg(long, value_name = "FILE", group = "wanted")]
    tum: Option<PathBuf>,
    /// Draw the floor plan to this SVG file, as the map.svg of `slamd replay`.
    #[arg(long, value_name = "FILE", group = "wanted")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    how: HowArgs,
    #[command(flatten)]
    force: ForceArg,
}

/// The files being written.
struct Exports {
    bag: Option<Bag>,
    table: Option<PoseTable>,
    trajectory: Option<Trajectory>,
}

impl ExportArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let mut guard = self.force.guard().reads(&self.file).reads_all(self.how.named());
        let mut output = |path: &Option<PathBuf>| path.as_deref().map(|path| guard.output(path)).transpose();
        let outputs = [output(&self.mcap)?, output(&self.csv)?, output(&self.tum)?];
        let plan = output(&self.svg)?;
        // Of the session's own output files only the floor plan is wanted here.
        let folder = tempfile::tempdir().map_err(|error| {
            Failure::new(
                Kind::CantCreate,
                format!("a temporary folder: {error}; name one that can be written in TMPDIR"),
            )
        })?;
        let began_unix_us = CaptureReader::open(&self.file)?.info().unix_zero_us;
        let source = Source { began_unix_us, ..Source::default() };
        let own = Outputs::begin(folder.path(), source, &OutputGuard::new(true))?;
        let (mut capture, mut session) = open(&self.file, &StateArgs::default(), &self.how, own)?;
        let mut exports = begin(outputs, &session, began_unix_us)?;
        session.keep_sweeps();
        let events = collect_events(&mut session);
        let bar = terminal::progress(None);
        for record in &mut capture {
            let record = record?;
            terminal::show(&bar, record.at().seconds());
            step(&mut session, &record)?;
            exports.take(&mut session, &events.take())?;
        }
        session.end();
        exports.take(&mut session, &events.take())?;
        bar.finish_and_clear();
        if let Some(damage) = capture.damage() {
            tracing::warn!("{}: {damage}; what was readable has been used", self.file.display());
        }
        self.finish(exports, &session)?;
        let Some(plan) = plan else { return Ok(()) };
        let path = plan.path().to_owned();
        let (summary, _) = session.finish().map_err(cannot_write)?;
        if let Some(reason) = summary.nothing_mapped {
            return Err(Failure::new(Kind::NothingMapped, format!("there is no floor plan to draw: {reason}")));
        }
        let svg = std::fs::read(folder.path().join("map.svg"))
            .map_err(|error| Failure::new(Kind::CantCreate, format!("{}: {error}", folder.path().display())))?;
        plan.write(&svg).map_err(cannot_write)?;
        terminal::say(format_args!("floor plan: {}", path.display()));
        Ok(())
    }

    /// Completes all files, then gives them their names.
    fn finish(&self, exports: Exports, session: &Session) -> Result<(), Failure> {
        let Exports { bag, table, trajectory } = exports;
        let bag = bag.map(|bag| bag.complete(session.now(), session.pipeline())).transpose()?;
        let table = table.map(PoseTable::complete).transpose().map_err(cannot_write)?;
        let trajectory = trajectory.map(Trajectory::complete).transpose().map_err(cannot_write)?;
        if let Some((path, (file, messages, topics))) = self.mcap.as_deref().zip(bag) {
            file.name().map_err(cannot_write)?;
            terminal::say(format_args!("ROS 2 bag: {}, {messages} messages on {topics} topics", path.display()));
        }
        for (path, file) in self.csv.iter().zip(table).chain(self.tum.iter().zip(trajectory)) {
            file.name().map_err(cannot_write)?;
            terminal::say(format_args!("poses: {}", path.display()));
        }
        Ok(())
    }
}

/// Begins the files: the bag, the table, the trajectory.
fn begin(
    [bag, table, trajectory]: [Option<Output>; 3],
    session: &Session,
    unix_zero_us: Option<u64>,
) -> Result<Exports, Failure> {
    Ok(Exports {
        bag: bag.map(|output| Bag::create(output, session.config(), unix_zero_us)).transpose()?,
        table: table.map(PoseTable::begin).transpose().map_err(cannot_write)?,
        trajectory: trajectory.map(Trajectory::begin).transpose().map_err(cannot_write)?,
    })
}

impl Exports {
    /// Takes the last input's events and sweeps.
    fn take(&mut self, session: &mut Session, events: &[Event]) -> Result<(), Failure> {
        let sweeps = session.take_sweeps();
        if let Some(bag) = &mut self.bag {
            bag.take(session.now(), session.pipeline(), events, &sweeps)?;
        }
        for event in events {
            let Event::Estimate(estimate) = event else { continue };
            if let Some(table) = &mut self.table {
                table.append(estimate);
            }
            if let Some(trajectory) = &mut self.trajectory {
                trajectory.append(estimate.at, estimate.pose);
            }
        }
        Ok(())
    }
}

/// Collects the events of a session.
fn collect_events(session: &mut Session) -> Rc<RefCell<Vec<Event>>> {
    let events = Rc::new(RefCell::new(Vec::new()));
    let collected = Rc::clone(&events);
    session.watch(Box::new(move |_, update| {
        if let Update::Event(event) = update {
            collected.borrow_mut().push(event.clone());
        }
    }));
    events
}

fn cannot_write(error: impl Into<BagError>) -> Failure {
    error.into().into()
}

impl From<BagError> for Failure {
    fn from(error: BagError) -> Self {
        Self::new(Kind::CantCreate, format!("{error}; name a file that can be written"))
    }
}
