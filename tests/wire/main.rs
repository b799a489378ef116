//! The serial line: cable faults, hostile bytes, the simulated daemon and the emulated board.

mod emulator;
mod fuzz;
mod link;
mod live;
mod replug;
mod simulation;
