//! The slamd daemon and command line: ports, sources and outputs around the estimator of `slamd_core`.
//!
//! `port or capture → source::session → slamd_core pipeline → events → output folder, API, MQTT, monitor, viewer, log`
//!
//! The estimator has no port, file or clock; all I/O is here. Start reading at [`cli`] for a command, at [`daemon`] for the loop of a live
//! session, and at [`source::session`] for how bytes become events. ARCHITECTURE.md describes all crates.

#![forbid(unsafe_code)]
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod calibrate;
pub mod doctor;
pub mod inspect;
pub mod session_file;
pub mod setup;
pub mod source;

pub mod api;
pub mod cli;
pub mod daemon;
mod descriptors;
pub mod drive;
mod log_counts;
pub mod monitor;
#[cfg(feature = "mqtt")]
pub mod mqtt;
pub mod port;
pub mod priority;
pub mod recorder;
pub mod service;
