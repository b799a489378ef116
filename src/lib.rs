//! slamd: a robot with a ring of cheap ultrasonic sensors and two wheel encoders maps a home.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`
//!
//! Bytes and time go in, events come out, and nothing in between touches the world. Start reading at [`pipeline`].

#![forbid(unsafe_code)]

pub mod event;
pub mod geometry;
pub mod sweep;
pub mod time;

pub mod config;
pub mod saved_state;

pub mod align;
pub mod board;
pub mod conversation;
pub mod handshake;
pub mod link;
pub mod settings;

pub mod fault;
pub mod mapping;
pub mod orientation;
pub mod position;

pub mod localize;
pub mod paper;
pub mod wall_slam;

pub mod pipeline;

pub mod calibrate;
pub mod capture;
pub mod doctor;
pub mod import;
pub mod inspect;
pub mod metrics;
pub mod publish;
pub mod ros2;
pub mod session_file;
pub mod sim;
pub mod source;

pub mod api;
pub mod bench;
pub mod cli;
pub mod daemon;
pub mod monitor;
#[cfg(feature = "mqtt")]
pub mod mqtt;
pub mod port;
pub mod priority;
pub mod private;
pub mod recorder;
pub mod service;
#[cfg(feature = "viewer")]
pub mod viewer;
