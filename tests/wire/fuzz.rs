//! 50 million bytes and 10,000 files; `cargo xtask fuzz` does a thousand million and a million, and times them.

use slamd_core::{Config, Start};
use slamd_testkit::fuzzing;
use slamd_testkit::fuzzing::{Corpus, Kind};

const BYTES: u64 = 50_000_000;
/// Bytes from one seed, of which a fourth are frames that reach the estimator.
const AT_ONCE: u64 = 5_000_000;
const FILES: u64 = 10_000;
/// What an honest drive needs is far below; a length that is believed is far above.
const MAX_KIB: u64 = 400 << 10;

#[test]
fn no_bytes_panic() {
    let corpus = Corpus::build();
    let outcomes = in_threads(BYTES / AT_ONCE, |seed| corpus.bytes(AT_ONCE, seed));
    for outcome in &outcomes {
        // Each input has bounded work: nothing comes out that did not come in.
        assert!(outcome.outputs < outcome.bytes / 8, "{outcome:?}");
    }
    let sum = |value: fn(&fuzzing::Outcome) -> u64| outcomes.iter().map(value).sum::<u64>();
    let (bytes, frames, sweeps) = (sum(|o| o.bytes), sum(|o| o.frames), sum(|o| o.sweeps));
    println!("{bytes} bytes, {frames} frames, {sweeps} sweeps, {} MiB", fuzzing::most_resident_kib() >> 10);
    assert!(bytes >= BYTES && sweeps > 2_000, "{bytes} bytes, {sweeps} sweeps");
    assert!(fuzzing::most_resident_kib() < MAX_KIB);
}

#[test]
fn no_file_panics() {
    let corpus = Corpus::build();
    let folder = tempfile::tempdir().expect("a folder");
    for kind in Kind::ALL {
        let count = FILES / Kind::ALL.len() as u64 + 1;
        let outcomes = in_threads(count, |seed| {
            let own = folder.path().join(format!("{kind:?}{seed}"));
            std::fs::create_dir(&own).expect("a folder");
            let outcome = corpus.file(kind, seed, &own);
            std::fs::remove_dir_all(&own).expect("removed");
            outcome
        });
        let accepted = outcomes.iter().filter(|outcome| outcome.accepted).count();
        println!("{kind:?}: {accepted} of {count} accepted, {} MiB", fuzzing::most_resident_kib() >> 10);
        assert!(accepted > 0 && (accepted as u64) < count, "{kind:?}: {accepted} of {count}");
    }
    assert!(fuzzing::most_resident_kib() < MAX_KIB);
}

#[test]
fn what_coverage_guided_fuzzing_found_is_tried_again() {
    let corpus = Corpus::build();
    let (mut count, mut accepted) = (0, 0);
    for (target, _) in corpus.seeds() {
        for input in fuzzing::found(target) {
            count += 1;
            let is_accepted = match target {
                "line" => fuzzing::line(&input, &Config::default()).sweeps > 0,
                "capture" => fuzzing::read_capture(&input),
                "session" => fuzzing::read_session(&input) || fuzzing::read_sealed_session(&input),
                "config" => fuzzing::read_config(&String::from_utf8_lossy(&input), corpus.start()),
                "map" => fuzzing::read_map(&input, corpus.saved_state()),
                "request" => input.split_first().is_some_and(|(first, requests)| {
                    fuzzing::read_requests_of_a_client(requests, first % 4 == 0, 1 + usize::from(first / 4))
                }),
                other => panic!("{other}: a target without its door here"),
            };
            accepted += u32::from(is_accepted);
        }
    }
    println!("{count} inputs, {accepted} accepted");
    assert!(count > 100, "{count}: fuzz/found/ is empty");
}

#[test]
fn a_wall_that_was_seen_too_often_to_count_is_seen_again() {
    let corpus = Corpus::build();
    let mut memory = corpus.saved_state();
    memory.walls.iter_mut().for_each(|wall| wall.hits = u32::MAX);
    let mut pipeline = slamd_paper::pipeline(&Config::default(), Start::Resume(Box::new(memory))).expect("sound");
    corpus.drive(&mut pipeline);
    let walls = pipeline.saved_state().expect("it goes on").walls;
    assert!(pipeline.counters().sweeps > 100 && walls.iter().any(|wall| wall.hits == u32::MAX), "{walls:?}");
}

/// Both cores; the results in the order of the seeds.
fn in_threads<T: Send>(count: u64, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let (evens, odds): (Vec<u64>, Vec<u64>) = (0..count).partition(|seed| seed % 2 == 0);
    std::thread::scope(|scope| {
        let threads = [evens, odds].map(|seeds| scope.spawn(|| seeds.into_iter().map(&work).collect::<Vec<T>>()));
        threads.into_iter().flat_map(|thread| thread.join().expect("no panic")).collect()
    })
}
