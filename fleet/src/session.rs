//! The id of a robot's drive, computed from its capture.

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use slamd_capture::{CaptureInfo, Record};
use std::fmt;
use std::str::FromStr;

/// A session's number. Of a robot's sessions the greatest is the newest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct SessionId {
    /// Time of the first record, microseconds since 1970, or since the session's start if the wall-clock
    /// time is unknown.
    began_us: u64,
    /// The beginning of a digest of what the capture says about itself, and of its first record: tells captures apart that began at once.
    mark: u32,
}

impl SessionId {
    /// The number of a capture that says this about itself and begins with this record.
    #[must_use]
    pub fn of(info: &CaptureInfo, first: &Record) -> Self {
        let began_us = info.unix_zero_us.unwrap_or(0).saturating_add(first.at().us());
        let mut digest = Sha256::new();
        for text in [&info.slamd_version, &info.protocol_version, &info.config_toml, &info.notes] {
            digest.update((text.len() as u64).to_le_bytes());
            digest.update(text);
        }
        if let Record::Received { bytes, .. } | Record::Sent { bytes, .. } = first {
            digest.update(bytes);
        }
        let digest: [u8; 32] = digest.finalize().into();
        let [a, b, c, d, ..] = digest;
        Self { began_us, mark: u32::from_be_bytes([a, b, c, d]) }
    }
}

impl fmt::Display for SessionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:020}-{:08x}", self.began_us, self.mark)
    }
}

impl FromStr for SessionId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('-').and_then(|(began, mark)| {
            Some(Self { began_us: began.parse().ok()?, mark: u32::from_str_radix(mark, 16).ok()? })
        });
        // Only the form in which it is written: it becomes a file's name.
        parts.filter(|session| session.to_string() == text).ok_or_else(|| format!("{text:?} is no session's number"))
    }
}

impl TryFrom<String> for SessionId {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<SessionId> for String {
    fn from(session: SessionId) -> Self {
        session.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::Timestamp;

    #[test]
    fn later_captures_are_greater_and_names_read_back() {
        let first = |us| Record::Received { at: Timestamp::from_us(us), bytes: vec![1] };
        let info = |unix_zero_us, notes: &str| CaptureInfo { unix_zero_us, notes: notes.into(), ..Default::default() };
        let old = SessionId::of(&info(Some(5_000_000), ""), &first(7));
        let later_part = SessionId::of(&info(Some(5_000_000), ""), &first(3_600_000_000));
        let new = SessionId::of(&info(Some(9_000_000_000_000), ""), &first(0));
        assert!(old < later_part && later_part < new);
        assert_ne!(SessionId::of(&info(None, "a"), &first(7)), SessionId::of(&info(None, "b"), &first(7)));
        assert_eq!(old.to_string().parse(), Ok(old));
        for bad in ["", "../../x", "1-2", "00000000000005000007-XYZ", "+0000000000005000007-00000000"] {
            assert!(bad.parse::<SessionId>().is_err(), "{bad:?}");
        }
    }
}
