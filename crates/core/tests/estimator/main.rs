//! The default method on simulated drives and committed captures, and the conversation with the board: no process, no port.

mod allocation;
mod config;
mod faults;
mod handshake;
mod honest;
mod link_states;
mod localize;
mod lock;
mod motion;
mod moved;
mod noisy_map;
mod params;
mod resume;
mod robot_model;
mod sensor_faults;
mod time_jumps;
mod troubles;
