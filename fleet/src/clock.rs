//! The only clock, used for waiting. No result depends on it.

use std::time::Duration;

/// A point in time to measure from.
#[derive(Clone, Copy, Debug)]
pub struct Moment(std::time::Instant);

impl Moment {
    /// Now.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "pace and patience; nothing is computed from it")]
    pub fn now() -> Self {
        Self(std::time::Instant::now())
    }

    /// How long ago it was.
    #[must_use]
    pub fn elapsed(self) -> Duration {
        self.0.elapsed()
    }
}

/// Waits.
#[expect(clippy::disallowed_methods, reason = "threads of their own wait, never the pipeline's inputs")]
pub fn wait(span: Duration) {
    std::thread::sleep(span);
}
