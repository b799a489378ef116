//! A disk in memory that fails in the ways that disks do.

use slamd::recorder::{Chunk, Disk, Presence};
use slamd_capture::{CaptureReader, Record};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// What a disk does with the next write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IoMode {
    /// Takes everything.
    #[default]
    Working,
    /// Takes so many bytes of each write.
    Short(usize),
    /// Has room for so many more bytes, then fails with ENOSPC.
    Room(usize),
    /// Fails with EIO.
    Broken,
    /// Creates files, and fails with EIO at each write.
    NamesOnly,
    /// Fails with EIO in files that exist; takes new ones: it was taken out and put back.
    Stale,
}

#[derive(Debug, Default)]
pub struct State {
    pub mode: IoMode,
    pub free_bytes: Option<u64>,
    pub files: BTreeMap<u32, Vec<u8>>,
    pub removed: Vec<u32>,
    /// Files created so far.
    pub created: u64,
    /// The calls that fail with EIO, by their numbers from 0 on.
    pub failing_calls: std::ops::Range<u64>,
    /// Calls so far.
    pub calls: u64,
    /// Files under another name.
    pub renamed: Vec<u32>,
    stale: Vec<u32>,
}

/// The disk; its clones are the same disk.
#[derive(Clone, Debug, Default)]
pub struct FaultyDisk(pub Rc<RefCell<State>>);

/// A file on it.
pub struct FaultyFile {
    disk: FaultyDisk,
    part: u32,
}

impl FaultyDisk {
    pub fn set_mode(&self, mode: IoMode) {
        let mut state = self.0.borrow_mut();
        state.mode = mode;
        if mode == IoMode::Stale {
            state.stale = state.files.keys().copied().collect();
        }
    }

    pub fn is_well(&self) -> bool {
        self.0.borrow().mode == IoMode::Working
    }

    /// Does something to the bytes of the newest file.
    pub fn damage_newest(&self, damage: impl FnOnce(&mut Vec<u8>)) {
        if let Some(mut newest) = self.0.borrow_mut().files.last_entry() {
            damage(newest.get_mut());
        }
    }

    /// The records of all parts in their order, and what is wrong with each file.
    pub fn read(&self) -> (Vec<Record>, Vec<Option<String>>) {
        let (mut records, mut damage) = (Vec::new(), Vec::new());
        for file in self.0.borrow().files.values() {
            let mut reader = CaptureReader::begin(file.as_slice(), Path::new("memory.mcap")).expect("it opens");
            records.extend(reader.by_ref().map(|record| record.expect("it is sound")));
            damage.push(reader.damage().map(Into::into));
        }
        (records, damage)
    }
}

impl State {
    /// Counts a call, and fails where it shall.
    fn call(&mut self) -> io::Result<()> {
        let number = self.calls;
        self.calls += 1;
        if self.failing_calls.contains(&number) { Err(io::Error::from_raw_os_error(5)) } else { Ok(()) }
    }
}

impl Disk for FaultyDisk {
    type File = FaultyFile;

    fn create(&mut self, part: u32) -> io::Result<FaultyFile> {
        let mut state = self.0.borrow_mut();
        state.call()?;
        match state.mode {
            IoMode::Broken => return Err(io::Error::from_raw_os_error(5)),
            IoMode::Room(0) => return Err(ErrorKind::StorageFull.into()),
            _ => {}
        }
        state.created += 1;
        state.files.insert(part, Vec::new());
        Ok(FaultyFile { disk: self.clone(), part })
    }

    fn presence(&mut self, part: u32, _: &FaultyFile) -> io::Result<Presence> {
        let mut state = self.0.borrow_mut();
        state.call()?;
        Ok(match state.files.contains_key(&part) {
            _ if state.renamed.contains(&part) => Presence::Renamed,
            true => Presence::There,
            false => Presence::Removed,
        })
    }

    fn remove(&mut self, part: u32) -> io::Result<()> {
        let mut state = self.0.borrow_mut();
        state.call()?;
        state.removed.push(part);
        state.files.remove(&part).map(drop).ok_or_else(|| ErrorKind::NotFound.into())
    }

    fn free_bytes(&mut self) -> Option<u64> {
        self.0.borrow().free_bytes
    }

    fn path(&self, part: u32) -> PathBuf {
        format!("memory-{part}.mcap").into()
    }
}

impl Write for FaultyFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut state = self.disk.0.borrow_mut();
        state.call()?;
        let State { mode, files, stale, .. } = &mut *state;
        let count = match mode {
            IoMode::Broken | IoMode::NamesOnly => return Err(io::Error::from_raw_os_error(5)),
            IoMode::Stale if stale.contains(&self.part) => return Err(io::Error::from_raw_os_error(5)),
            IoMode::Room(0) => return Err(ErrorKind::StorageFull.into()),
            IoMode::Room(room) => {
                let count = bytes.len().min(*room);
                *room -= count;
                count
            }
            IoMode::Short(most) => bytes.len().min(*most),
            IoMode::Working | IoMode::Stale => bytes.len(),
        };
        // A deleted file can still be written through an open handle.
        if let Some(file) = files.get_mut(&self.part) {
            file.extend(&bytes[..count]);
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        let mut state = self.disk.0.borrow_mut();
        state.call()?;
        match state.mode {
            IoMode::Broken => Err(io::Error::from_raw_os_error(5)),
            _ => Ok(()),
        }
    }
}

/// A chunk as the capture gives it back.
pub fn record(chunk: &Chunk) -> Record {
    match chunk {
        Chunk::Received(at, bytes) => Record::Received { at: *at, bytes: bytes.to_vec() },
        Chunk::Sent(at, bytes) => Record::Sent { at: *at, bytes: bytes.to_vec() },
        Chunk::Opened(at) => Record::Opened { at: *at },
    }
}
