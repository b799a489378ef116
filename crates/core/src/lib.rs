//! The estimator of slamd: bytes and time in, poses, faults and a map out.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`

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
pub mod wall_slam;

pub mod pipeline;

pub mod driver;
pub mod rates;
pub mod session_clock;
pub mod snapshot;
