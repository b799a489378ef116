//! Is the robot where the filter believes it is, and if not, where?
//!
//! 1. Each reading is compared with the map ([`agreement`]): it is explained, contradicted, or the map does not tell.
//! 2. The log-likelihood ratio of "elsewhere" against "here" is summed along the way ([`monitor`], CUSUM). A low limit suspends the map,
//!    a high one declares the pose lost since the sum was last zero.
//!    Most readings changing at once while the wheels stand do so, too ([`jump`]).
//! 3. While it is lost, the readings of the last metres ([`trail`]) are laid out on the map: near the believed pose, and everywhere under
//!    four quarter turns ([`scan`]). The best poses are compared by the same likelihood and a prior: a robot is likelier pushed than
//!    turned or carried, unless the readings showed that it was carried ([`search`]). One is accepted if it explains most of the readings,
//!    no other pose is nearly as likely, and, if it is far from the believed one, a search later finds it again.
//!
//! What the map does not tell counts for nothing: a robot that enters a new room is not lost.

pub(super) mod agreement;
mod field;
pub(super) mod jump;
pub(super) mod monitor;
pub(crate) mod params;
mod scan;
pub(super) mod search;
pub(super) mod trail;
