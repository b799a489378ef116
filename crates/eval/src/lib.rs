//! Evaluation: accuracy tables over simulated drives, the paper's experiment, and the import of foreign recordings.

#![forbid(unsafe_code)]

pub mod bench;
pub mod import;
pub mod plot;
