//! The source tree itself: which crate uses which, lints, dependencies, and a test for each promise.

mod dependencies;
mod input_path;
mod layering;
mod people;
mod reliability;
mod security;
