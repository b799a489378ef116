//! Sources of bytes: a live link, a capture, a simulated board. All feed the same session.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

pub mod checkpoints;
mod event_log;
pub mod live;
pub mod pty;
pub mod replay;
pub mod session;
