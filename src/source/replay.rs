//! A capture as a source, replayed as fast as possible.

use super::session::Session;
use slamd_capture::{CaptureError, CaptureReader, Record};
use slamd_publish::WriteError;

/// A replay that cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The capture cannot be read.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// An output cannot be written.
    #[error(transparent)]
    Publish(#[from] WriteError),
}

/// Feeds a whole capture to a session, and ends it. `progress` gets each record's time in seconds.
///
/// # Errors
/// When the capture cannot be read or an output cannot be written.
pub fn replay(capture: &mut CaptureReader, session: &mut Session, progress: impl Fn(f64)) -> Result<(), ReplayError> {
    for record in capture {
        let record = record?;
        progress(record.at().seconds());
        step(session, &record)?;
    }
    session.end();
    Ok(())
}

/// Feeds one record of a capture to a session.
///
/// # Errors
/// When an output cannot be written.
pub fn step(session: &mut Session, record: &Record) -> Result<(), WriteError> {
    session.feed(record)?;
    // The capture holds the frames that were really sent, so the new ones are discarded.
    session.take_transmit();
    Ok(())
}
