//! `faults.csv`: one line for each change of a sensor's or a wheel encoder's state.

use super::WriteError;
use slamd_core::{EncoderEvent, EncoderState, FaultEvent, SensorState};
use slamd_files::{CompleteFile, PartFile};
use std::fs::File;
use std::path::Path;

/// The file being written.
pub(super) struct FaultLog {
    file: PartFile,
}

impl FaultLog {
    pub(super) fn create(folder: &Path) -> Result<Self, WriteError> {
        let mut file = PartFile::create(&folder.join("faults.csv"))?;
        file.append(b"t_s,sensor,state,kind\n");
        Ok(Self { file })
    }

    pub(super) fn append(&mut self, fault: &FaultEvent) {
        self.file.append(line(fault).as_bytes());
    }

    pub(super) fn append_encoder(&mut self, encoder: &EncoderEvent) {
        self.file.append(encoder_line(encoder).as_bytes());
    }

    /// Gives the file its name while it grows.
    pub(super) fn publish(&mut self) -> Result<File, WriteError> {
        self.file.publish()
    }

    pub(super) fn complete(self) -> Result<CompleteFile, WriteError> {
        self.file.complete()
    }
}

fn line(fault: &FaultEvent) -> String {
    let (state, kind) = match fault.state {
        SensorState::Healthy => ("healthy", ""),
        SensorState::Faulty(kind) => ("faulty", kind.word()),
    };
    format!("{:.6},{},{state},{kind}\n", fault.at.seconds(), fault.sensor)
}

/// In place of a sensor's number the wheel's name.
fn encoder_line(encoder: &EncoderEvent) -> String {
    let (state, kind) = match encoder.state {
        EncoderState::Healthy => ("healthy", ""),
        broken => ("faulty", broken.word()),
    };
    format!("{:.6},{} encoder,{state},{kind}\n", encoder.at.seconds(), encoder.wheel.word())
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{FaultKind, Timestamp, Wheel};

    #[test]
    fn a_line_names_time_sensor_state_and_kind() {
        let at = Timestamp::from_us(1_500_000);
        let state = SensorState::Faulty(FaultKind::Missing);
        let fault = FaultEvent { at, sensor: 7, state, reason: "never answers".into() };
        assert_eq!(line(&fault), "1.500000,7,faulty,missing\n");
        assert_eq!(line(&FaultEvent { state: SensorState::Healthy, ..fault }), "1.500000,7,healthy,\n");
    }

    #[test]
    fn an_encoder_has_its_wheels_name() {
        let at = Timestamp::from_us(2_500_000);
        let encoder = EncoderEvent { at, wheel: Wheel::Left, state: EncoderState::Dead, reason: String::new() };
        assert_eq!(encoder_line(&encoder), "2.500000,left encoder,faulty,dead\n");
        let healthy = EncoderEvent { state: EncoderState::Healthy, ..encoder };
        assert_eq!(encoder_line(&healthy), "2.500000,left encoder,healthy,\n");
    }
}
