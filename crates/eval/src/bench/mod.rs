//! Evaluation: simulated drives by the hundred, and the paper's experiment; tables and pictures that one command makes again.

pub mod case;
pub mod earliest;
pub mod fleet;
pub mod machine;
pub mod paper;
pub mod raw;
pub mod report;
pub mod run;
pub mod table;
pub mod targets;
