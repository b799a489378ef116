//! Poses as a table for spreadsheets and scripts: a CSV file with a head, one row per pose.

use super::WriteError;
use slamd_core::Estimate;
use slamd_files::{CompleteFile, Output, PartFile};

/// A table being written; memory stays constant however long the run.
pub struct PoseTable {
    file: PartFile,
}

const HEAD: &str = "time_s,x_m,y_m,theta_rad,variance_x_m2,variance_y_m2,variance_theta_rad2\n";

impl PoseTable {
    /// Begins the file.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn begin(output: Output) -> Result<Self, WriteError> {
        let mut file = output.begin()?;
        file.append(HEAD.as_bytes());
        Ok(Self { file })
    }

    /// Adds a pose.
    pub fn append(&mut self, estimate: &Estimate) {
        self.file.append(line(estimate).as_bytes());
    }

    /// Completes the file; it has no name yet.
    ///
    /// # Errors
    /// When something of it could not be written.
    pub fn complete(self) -> Result<CompleteFile, WriteError> {
        self.file.complete()
    }
}

fn line(estimate: &Estimate) -> String {
    let Estimate { at, pose, covariance, .. } = estimate;
    let [x_m2, y_m2, theta_rad2] = [0, 1, 2].map(|axis| covariance[(axis, axis)]);
    format!(
        "{:.6},{:.6},{:.6},{:.6},{x_m2:.3e},{y_m2:.3e},{theta_rad2:.3e}\n",
        at.seconds(),
        pose.x_m,
        pose.y_m,
        pose.theta_rad
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use slamd_core::{Pose2, Timestamp};

    #[test]
    fn a_row_has_as_many_columns_as_the_head() {
        let estimate = Estimate {
            at: Timestamp::from_us(12_000_034),
            sweep: 3,
            pose: Pose2::new(1.5, -0.25, 3.0),
            covariance: Matrix3::from_diagonal(&Vector3::new(1e-4, 2.5e-4, 3e-6)),
            odometry: Pose2::default(),
            nis: 1.0,
        };
        let row = line(&estimate);
        assert_eq!(row, "12.000034,1.500000,-0.250000,3.000000,1.000e-4,2.500e-4,3.000e-6\n");
        assert_eq!(row.matches(',').count(), HEAD.matches(',').count());
    }
}
