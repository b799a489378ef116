//! How accurate the maps are: committed captures, public recordings, calibration, and the tables of `slamd bench`.

mod bench;
mod calibration;
mod cases;
mod evo;
mod importing;
mod recordings;
mod replay;
mod stated_bounds;
