//! Trajectories as TUM files: `t x y z qx qy qz qw` per line, seconds and metres, as the evaluation tools evo and rpg read.

use super::WriteError;
use slamd_core::{Pose2, Timestamp};
use slamd_files::{CompleteFile, Output, PartFile};
use std::fs::File;
use std::path::Path;

/// A trajectory being written; memory stays constant however long the run.
pub struct Trajectory {
    file: PartFile,
}

impl Trajectory {
    /// Begins a file in an output folder.
    ///
    /// # Errors
    /// When it cannot be created.
    pub(super) fn create(path: &Path) -> Result<Self, WriteError> {
        Ok(Self { file: PartFile::create(path)? })
    }

    /// Begins a file that the user named.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn begin(output: Output) -> Result<Self, WriteError> {
        Ok(Self { file: output.begin()? })
    }

    /// Adds a pose.
    pub fn append(&mut self, at: Timestamp, pose: Pose2) {
        self.file.append(line(at, pose).as_bytes());
    }

    /// Gives the file its name while it grows.
    pub(super) fn publish(&mut self) -> Result<File, WriteError> {
        self.file.publish()
    }

    /// Completes the file; it has no name yet.
    ///
    /// # Errors
    /// When something of it could not be written.
    pub fn complete(self) -> Result<CompleteFile, WriteError> {
        self.file.complete()
    }
}

fn line(at: Timestamp, pose: Pose2) -> String {
    let (qz, qw) = libm::sincos(0.5 * pose.theta_rad);
    let (whole_s, rest_us) = (at.us() / 1_000_000, at.us() % 1_000_000);
    format!("{whole_s}.{rest_us:06} {:.6} {:.6} 0 0 0 {qz:.9} {qw:.9}\n", pose.x_m, pose.y_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_time_position_and_a_turn_about_z() {
        let text = line(Timestamp::from_us(12_000_034), Pose2::new(1.5, -0.25, std::f64::consts::FRAC_PI_2));
        assert_eq!(text, "12.000034 1.500000 -0.250000 0 0 0 0.707106781 0.707106781\n");
    }
}
