//! Sums up log lines whose cause repeats: a board, a client or a disk may cause thousands in a second.

use crate::log_counts::{DROPPED, SUMMED_UP};
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tracing::callsite::Identifier;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer};

/// Lines of one place in the code that are written in a period; further ones are counted.
const BURST: u32 = 30;
/// The same after a period with more.
const FEW: u32 = 3;
/// The first period; it doubles up to the last while there are more lines.
const FIRST_PERIOD: Duration = Duration::from_secs(10);
const LAST_PERIOD: Duration = Duration::from_secs(160);
/// Period of looking for dropped lines.
const IDLE: Duration = Duration::from_secs(5);
/// Characters of a line that its summary repeats.
const SAMPLE: usize = 100;
/// The summaries' target, which is not limited.
const TARGET: &str = "slamd_log";

/// The layer that lets a line pass or counts it.
pub(super) struct Limiter(Arc<Shared>);

#[derive(Default)]
struct Shared {
    sources: Mutex<HashMap<Identifier, Source>>,
    /// Something was counted.
    wake: Condvar,
}

/// One place in the code.
struct Source {
    level: Level,
    began: Instant,
    period: Duration,
    allowed: u32,
    passed: u32,
    more: u64,
    /// The beginning of the last line that did not pass.
    sample: String,
}

/// What did not pass in a period.
#[derive(Debug, PartialEq, Eq)]
struct Summary {
    level: Level,
    text: String,
}

impl Limiter {
    /// A limiter, with the thread that writes its summaries.
    #[expect(clippy::disallowed_methods, reason = "the log lives in real time")]
    pub(super) fn begin() -> Self {
        let shared = Arc::<Shared>::default();
        let thread = {
            let shared = Arc::clone(&shared);
            move || {
                let mut dropped = 0;
                loop {
                    shared.wait();
                    shared.tell(shared.due(Instant::now()));
                    tell_dropped(&mut dropped);
                }
            }
        };
        // Without the thread lines are only counted.
        let _ = std::thread::Builder::new().name("log-sums".into()).spawn(thread);
        Self(shared)
    }

    /// The handle that sums up at the end.
    pub(super) fn sums(&self) -> Sums {
        Sums(Arc::clone(&self.0))
    }
}

/// Writes what was counted and not yet told.
pub(super) struct Sums(Arc<Shared>);

impl Sums {
    /// To be called at the end of the program.
    #[expect(clippy::disallowed_methods, reason = "the log lives in real time")]
    pub(super) fn finish(&self) {
        self.0.tell(self.0.due(Instant::now() + LAST_PERIOD));
        tell_dropped(&mut 0);
    }
}

/// Says how many lines were dropped, once the reader reads again.
fn tell_dropped(told: &mut u64) {
    let dropped = DROPPED.get();
    if dropped > *told {
        *told = dropped;
        tracing::warn!(target: TARGET, "{dropped} log lines so far were dropped, because nobody read them");
    }
}

impl Shared {
    fn sources(&self) -> MutexGuard<'_, HashMap<Identifier, Source>> {
        self.sources.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until something may be due.
    fn wait(&self) {
        let sources = self.sources();
        let is_idle = |sources: &mut HashMap<Identifier, Source>| sources.values().all(|source| source.more == 0);
        let (sources, _) = self.wake.wait_timeout_while(sources, IDLE, is_idle).unwrap_or_else(PoisonError::into_inner);
        // Within a second of a period's end.
        drop(self.wake.wait_timeout_while(sources, Duration::from_secs(1), |_| true));
    }

    /// The summaries of the periods that are over.
    fn due(&self, now: Instant) -> Vec<Summary> {
        self.sources().values_mut().filter_map(|source| source.due(now)).collect()
    }

    fn tell(&self, summaries: Vec<Summary>) {
        for Summary { level, text } in summaries {
            match level {
                Level::ERROR => tracing::error!(target: TARGET, "{text}"),
                Level::WARN => tracing::warn!(target: TARGET, "{text}"),
                _ => tracing::info!(target: TARGET, "{text}"),
            }
        }
    }

    /// True if the line may pass.
    fn admit(&self, id: Identifier, level: Level, now: Instant, text: impl FnOnce() -> String) -> bool {
        let mut sources = self.sources();
        let source = sources.entry(id).or_insert_with(|| Source {
            level,
            began: now,
            period: FIRST_PERIOD,
            allowed: BURST,
            passed: 0,
            more: 0,
            sample: String::new(),
        });
        // A period with more is ended by its summary.
        if source.more == 0 && now.saturating_duration_since(source.began) >= source.period {
            (source.began, source.period, source.allowed, source.passed) = (now, FIRST_PERIOD, BURST, 0);
        }
        if source.passed < source.allowed {
            source.passed += 1;
            return true;
        }
        if source.more == 0 {
            source.sample = text();
            self.wake.notify_all();
        }
        source.more += 1;
        SUMMED_UP.increment();
        false
    }
}

impl Source {
    fn due(&mut self, now: Instant) -> Option<Summary> {
        let elapsed = now.saturating_duration_since(self.began);
        if self.more == 0 || elapsed < self.period {
            return None;
        }
        let seconds = elapsed.min(self.period).as_secs();
        let text = format!("{}: and {} more in {seconds} s", self.sample, grouped(self.more));
        (self.began, self.period, self.allowed) = (now, (self.period * 2).min(LAST_PERIOD), FEW);
        (self.passed, self.more) = (0, 0);
        Some(Summary { level: self.level, text })
    }
}

/// A number with its thousands set apart.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

impl<S: Subscriber> Layer<S> for Limiter {
    #[expect(clippy::disallowed_methods, reason = "the log lives in real time")]
    fn event_enabled(&self, event: &Event<'_>, _: Context<'_, S>) -> bool {
        let metadata = event.metadata();
        let is_asked_for = *metadata.level() > Level::INFO;
        if is_asked_for || metadata.target() == TARGET || metadata.target() == super::END_TARGET {
            return true;
        }
        let text = || {
            let mut text = Text::default();
            event.record(&mut text);
            text.0
        };
        self.0.admit(metadata.callsite(), *metadata.level(), Instant::now(), text)
    }
}

/// The beginning of an event's message.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            let text = format!("{value:?}");
            self.0 = text.chars().take(SAMPLE).collect();
            if self.0.len() < text.len() {
                self.0.push_str("...");
            }
        }
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "a time to count from")]
mod tests {
    use super::*;

    #[test]
    fn a_flood_becomes_a_few_lines_that_say_how_many_there_were() {
        let shared = Shared::default();
        let id = tracing::callsite::Identifier(&CALLSITE);
        let begin = Instant::now();
        let (mut passed, mut told, mut counted) = (0_u64, Vec::new(), 0_u64);
        let flood = 600 * 1_000;
        for i in 0..flood {
            let now = begin + Duration::from_millis(i);
            passed += u64::from(shared.admit(id.clone(), Level::INFO, now, || "board says: boo".into()));
            if i.is_multiple_of(1_000) {
                told.extend(shared.due(now));
            }
        }
        told.extend(shared.due(begin + Duration::from_hours(1)));
        for summary in &told {
            let number = summary.text.strip_prefix("board says: boo: and ").unwrap().split(' ').next().unwrap();
            counted += number.replace(',', "").parse::<u64>().unwrap();
        }
        assert_eq!(passed + counted, flood);
        assert!(passed + (told.len() as u64) < 80, "{passed} lines and {} summaries in ten minutes", told.len());
        assert!(told[0].text.ends_with("and 9,971 more in 10 s"), "{told:?}");
        // After a quiet time everything passes again.
        let later = begin + Duration::from_hours(2);
        let again = (0..BURST).filter(|_| shared.admit(id.clone(), Level::INFO, later, String::new)).count();
        assert_eq!(again, BURST as usize);
    }

    struct Callsite;
    static CALLSITE: Callsite = Callsite;

    impl tracing::Callsite for Callsite {
        fn set_interest(&self, _: tracing::subscriber::Interest) {}

        fn metadata(&self) -> &tracing::Metadata<'_> {
            unreachable!("nobody asks")
        }
    }

    #[test]
    fn numbers_are_readable() {
        assert_eq!([0, 999, 23_000, 1_234_567].map(grouped), ["0", "999", "23,000", "1,234,567"]);
    }
}
