//! Many drives at once, on all cores; each is as deterministic as it is alone.

use super::case::Case;
use super::run::{Run, run};
use slamd_sim::world::World;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Drives every case with every seed. Calls `done` as each drive ends, in any order. Returns the runs of each case by seed.
///
/// # Errors
/// Where a world cannot be read.
///
/// # Panics
/// Where a drive does.
pub fn drive_all(cases: &[Case], seeds: &[u64], done: impl Fn(&Case, &Run) + Sync) -> Result<Vec<Vec<Run>>, String> {
    // A file that cannot be read is an error before the first drive.
    let first = seeds.first().copied().unwrap_or_default();
    let worlds: Vec<World> = cases.iter().map(|case| case.load_world(first)).collect::<Result<_, _>>()?;
    let next = AtomicUsize::new(0);
    let runs: Vec<Mutex<Vec<Run>>> = cases.iter().map(|_| Mutex::new(Vec::new())).collect();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let job = next.fetch_add(1, Ordering::Relaxed);
                    let (Some(case), Some(&seed)) =
                        (cases.get(job / seeds.len().max(1)), seeds.get(job % seeds.len().max(1)))
                    else {
                        break;
                    };
                    let index = job / seeds.len();
                    let home;
                    let world = match World::for_seed(&case.world, seed) {
                        Some(world) => {
                            home = world;
                            &home
                        }
                        None => &worlds[index],
                    };
                    let run = run(case, world, seed);
                    done(case, &run);
                    runs[index].lock().expect("no drive panics").push(run);
                }
            });
        }
    });
    let mut all: Vec<Vec<Run>> = runs.into_iter().map(|runs| runs.into_inner().expect("no drive panics")).collect();
    for runs in &mut all {
        runs.sort_by_key(|run| run.seed);
    }
    Ok(all)
}
