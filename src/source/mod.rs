//! Where bytes come from, and the one driver that makes live and replay the same.

pub mod live;
pub mod pty;
pub mod replay;
pub mod session;
