//! The wire format between slamd and its board.
#![no_std]
