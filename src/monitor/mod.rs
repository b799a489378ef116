//! The terminal view of a session: a [`Dashboard`] in, cells of a screen out.
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
mod dashboard;
mod map;
mod numbers;
mod ring;
mod screen;
mod track;
mod view;

pub use dashboard::{Dashboard, Line, Plan, Tone};
pub use screen::{MIN_HEIGHT, MIN_WIDTH, clock, draw};
pub use slamd_core::{RateMeter, Rates};
pub use track::Track;
pub use view::{Look, View};
