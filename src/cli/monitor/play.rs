//! Plays a capture in real time or at a multiple of it.

use super::sampler::Sampler;
use crate::daemon::Shutdown;
use crate::monitor::{Line, Tone};
use crate::source::replay::{ReplayError, step};
use crate::source::session::Session;
use slamd_capture::CaptureReader;
use std::path::Path;
use std::time::{Duration, Instant};

/// Plays until the end is requested; the end of the capture stays on the screen.
///
/// # Errors
/// When the capture cannot be read or an output cannot be written.
#[expect(clippy::disallowed_methods, reason = "a capture in real time needs a clock")]
pub(super) async fn play(
    capture: &mut CaptureReader,
    session: &mut Session,
    speed: f64,
    shutdown: &mut Shutdown,
    sampler: &mut Sampler,
    file: &Path,
) -> Result<(), ReplayError> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let line = |word, cause, tone| Line { word, cause, tone };
    let (begin, mut first) = (Instant::now(), None);
    for record in &mut *capture {
        let record = record?;
        let first = *first.get_or_insert_with(|| record.at());
        let due = begin + Duration::from_secs_f64(record.at().seconds_since(first).max(0.0) / speed);
        tokio::select! {
            () = tokio::time::sleep_until(due.into()) => {}
            () = shutdown.requested() => return Ok(()),
        }
        step(session, &record)?;
        sampler.sample(Some(session), || line("playing", format!("{name} at {speed} x its speed"), Tone::Good));
    }
    let mut cause = format!("{name} is over; q quits");
    if let Some(damage) = capture.damage() {
        tracing::warn!("{name}: {damage}; what was readable has been used");
        cause = format!("{name} is damaged, what was readable is over; q quits");
    }
    sampler.sample_last(session, line("ended", cause, Tone::Busy));
    shutdown.requested().await;
    Ok(())
}
