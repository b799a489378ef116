//! slamd: a robot with a ring of cheap ultrasonic sensors and two wheel encoders maps a home.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`
//!
//! Bytes and time go in, events come out, and nothing in between touches the world. Start reading at [`pipeline`].

#![forbid(unsafe_code)]

pub mod calibrate;
pub mod doctor;
pub mod inspect;
pub mod session_file;
pub mod source;

pub mod api;
pub mod cli;
pub mod daemon;
pub mod monitor;
#[cfg(feature = "mqtt")]
pub mod mqtt;
pub mod port;
pub mod priority;
pub mod recorder;
pub mod service;
