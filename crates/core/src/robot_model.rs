//! Is the robot what its configuration says?

mod finding;

pub use finding::{ModelAspect, ModelEvent, ModelFinding, ModelState};
