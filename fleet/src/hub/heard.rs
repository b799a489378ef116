//! The received puts of a drive. The others are counted as lost when the capture is complete.

use std::collections::HashSet;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;

/// The kind of a put.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A pose.
    Pose,
    /// A sweep.
    Sweep,
}

/// The received puts of one drive. Each is written to disk first, as a line `p NUMBER` or `s NUMBER`.
#[derive(Debug)]
pub struct Heard {
    file: File,
    seqs: HashSet<(Kind, u64)>,
}

/// Maximum number of puts: more than a drive of one month has.
const MAX_PUTS: usize = 1 << 26;

impl Heard {
    /// Continues an existing file. An incomplete last line, left by a kill, is cut off.
    ///
    /// # Errors
    /// When the file cannot be opened or read.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut file = OpenOptions::new().read(true).append(true).create(true).mode(0o600).open(path)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |index| index + 1);
        file.set_len(whole as u64)?;
        let text = String::from_utf8_lossy(&bytes[..whole]);
        let seqs = text.lines().filter_map(|line| {
            let (kind, seq) = line.split_once(' ')?;
            let kind = [Kind::Pose, Kind::Sweep].into_iter().find(|known| known.word() == kind)?;
            Some((kind, seq.parse().ok()?))
        });
        Ok(Self { seqs: seqs.collect(), file })
    }

    /// Records a put. A repeated put changes nothing.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn note(&mut self, kind: Kind, seq: u64) -> io::Result<()> {
        if self.seqs.len() < MAX_PUTS && !self.seqs.contains(&(kind, seq)) {
            self.file.write_all(format!("{} {seq}\n", kind.word()).as_bytes())?;
            self.seqs.insert((kind, seq));
        }
        Ok(())
    }

    /// The number of `seqs` that were received.
    #[must_use]
    pub fn count(&self, kind: Kind, seqs: &[u64]) -> usize {
        seqs.iter().filter(|seq| self.seqs.contains(&(kind, **seq))).count()
    }
}

impl Kind {
    const fn word(self) -> &'static str {
        match self {
            Self::Pose => "p",
            Self::Sweep => "s",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn received_puts_survive_a_kill() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.heard");
        let mut heard = Heard::open(&path).unwrap();
        for seq in [4, 5, 5, 9] {
            heard.note(Kind::Pose, seq).unwrap();
        }
        heard.note(Kind::Sweep, 5).unwrap();
        drop(heard);
        let mut text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "p 4\np 5\np 9\ns 5\n");
        text.push_str("p 1");
        std::fs::write(&path, &text).unwrap();
        let mut heard = Heard::open(&path).unwrap();
        heard.note(Kind::Pose, 17).unwrap();
        let heard = Heard::open(&path).unwrap();
        assert_eq!(heard.count(Kind::Pose, &[1, 4, 5, 6, 9, 17]), 4);
        assert_eq!(heard.count(Kind::Sweep, &[4, 5]), 1);
    }
}
