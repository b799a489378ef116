//! Several robots, one map.
//!
//! `capture → pipeline → poses, sweeps, integer map → Zenoh → hub → captures again, byte for byte → one map`
//!
//! **A robot's capture is the only truth; everything else is computed from it**, by the same code on the robot, on the hub and offline
//! ([`player`]). What is published may be lost: the hub fetches the capture, and has all of it. Start reading at [`hub`].

pub mod name;
pub mod session;
pub mod wire;

pub mod align;
pub mod merge;
pub mod site;

pub mod clock;
pub mod follow;
pub mod player;

pub mod acl;
pub mod fleet_file;
pub mod network;
pub mod secret;

pub mod cli;
pub mod failure;
pub mod hub;
pub mod map_files;
pub mod robot;
pub mod union;
