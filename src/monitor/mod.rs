//! The terminal view of a session: a [`Snapshot`] in, cells of a screen out.
//!
//! ```text
//! title · link and its cause
//! ring from above │ rates, pose, wheels │ map with the robot
//! faulty sensors  │ last lines of the log
//! keys
//! ```
//!
//! Pure drawing: no terminal, no clock, no thread; `src/cli/monitor/` has those.

mod canvas;
mod map;
mod numbers;
mod ring;
mod screen;
mod snapshot;
mod view;

pub use screen::{MIN_HEIGHT, MIN_WIDTH, draw};
pub use slamd_core::rates::{RateMeter, Rates};
pub use snapshot::{Beam, BeamState, Line, Plan, Snapshot, Tone};
pub use view::{Look, View};
