//! The whole daemon in a simulated world: one seed makes building, robot, acoustics, board, line, clocks, disk and all that goes wrong with them.
//!
//! The code under test is the program's own, from the bytes of the port to the files: [`slamd::source::live::LiveSession`] is what the daemon does between
//! two wakes, [`slamd::recorder::Tape`] what its recorder does. A failure is a panic that names the seed and the command that repeats it.

mod cable;
mod ledger;
mod life;
mod met;
mod plan;
mod tear;
mod verdict;
mod watch;
mod world;

pub use met::Met;

use plan::Plan;
use slamd::session_file;
use slamd_core::Start;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::Command;
use world::World;

/// Runs one seed; what it has met.
///
/// # Panics
/// When something does not hold, with the seed, the commit and the command that repeats it.
pub fn simulate(seed: u64) -> Met {
    catch_unwind(AssertUnwindSafe(|| run(seed))).unwrap_or_else(|cause| {
        eprintln!("seed {seed}, commit {}: {:#?}", commit(), Plan::new(seed));
        eprintln!("again: cargo xtask simulation --first {seed} --seeds 1");
        std::panic::resume_unwind(cause)
    })
}

fn run(seed: u64) -> Met {
    let plan = Plan::new(seed);
    let folder = tempfile::tempdir().expect("a folder");
    let (lived, replayed) = (folder.path().join("lived"), folder.path().join("replayed"));
    let mut world = World::new(seed, &plan);
    let mut start = Start::Fresh;
    while let Some(remains) = life::live(&mut world, &plan, start.clone(), &lived) {
        let is_dead = remains.losses.is_none();
        let saved = remains.saved.clone();
        verdict::judge(&mut world, &plan, start, remains, &replayed);
        if !is_dead {
            break;
        }
        start = after_death(saved, &mut world);
    }
    world.met.runs = 1;
    world.met.clean_runs = u64::from(plan.is_clean);
    world.met.true_us = world.t_us;
    (world.met.slips, world.met.overrun) = (world.cable.slips, world.cable.overrun);
    world.met
}

/// What the next life begins with: the session file. One that a power cut has damaged is refused, and the one before it is taken.
fn after_death(saved: Option<Vec<u8>>, world: &mut World) -> Start {
    world.died = None;
    let Some(saved) = saved else { return Start::Fresh };
    let mut torn = saved.clone();
    tear::tear(&mut torn, &mut world.random);
    let read = session_file::decode(&torn);
    assert!(torn == saved || read.is_err(), "a damaged session file was accepted");
    Start::Resume(Box::new(session_file::decode(&saved).expect("it is whole")))
}

/// The commit that is checked out, as far as anybody knows.
fn commit() -> String {
    let output = Command::new("git").args(["rev-parse", "HEAD"]).current_dir(crate::root()).output();
    let output = output.ok().filter(|output| output.status.success());
    output.map_or_else(|| "unknown".into(), |output| String::from_utf8_lossy(&output.stdout).trim().into())
}

/// Runs the seeds on all cores and calls back after each.
pub fn simulate_all(seeds: std::ops::Range<u64>, done: impl Fn() + Sync) -> Met {
    let next = std::sync::atomic::AtomicU64::new(seeds.start);
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let work = || {
        let mut met = Met::default();
        loop {
            let seed = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if seed >= seeds.end {
                return met;
            }
            met.add(&simulate(seed));
            done();
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        let mut sum = Met::default();
        for thread in threads {
            match thread.join() {
                Ok(met) => sum.add(&met),
                Err(cause) => std::panic::resume_unwind(cause),
            }
        }
        sum
    })
}
