//! Is the robot what its configuration says?
//!
//! Wheels, ring and walls must tell one story. The check lays the returns of the latest metres out as other robots would have made
//! them: with other scales of travel and turning, with signs reversed, with the ring turned. The robot under which the walls are
//! sharpest is the true one. What differs has a name, a key and a value that mend it ([`ModelFinding`]).

mod check;
mod checked_slam;
mod concentration;
mod doubt;
mod finding;
mod history;
mod hypothesis;
mod naming;
pub(crate) mod params;
mod window;

pub(crate) use checked_slam::CheckedSlam;
pub use finding::{ModelAspect, ModelEvent, ModelFinding, ModelState};
pub(crate) use naming::ticks_remedy;
