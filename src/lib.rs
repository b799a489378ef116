//! slamd: a robot with a ring of cheap ultrasonic sensors and two wheel encoders maps a home.
//!
//! `bytes → Frame → Message → Sweep V[k] → fault mask → heading → pose → occupancy grid → events`
//!
//! Bytes and time go in, events come out, and nothing in between touches the world. Start reading at [`pipeline`].

pub mod config;
pub mod event;
pub mod geometry;
pub mod mapping;
pub mod sim;
pub mod sweep;
pub mod time;
