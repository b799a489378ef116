//! The files of a ROS 2 bag: MCAP or SQLite, alone or in a folder with `metadata.yaml`.

use super::super::ImportError;
use super::mcap_file;
use super::message::{Kind, Message};
use super::sqlite::{Database, Value};
use mcap::records::Record;
use slamd_files::regular;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// A message of a bag.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) topic: String,
    /// The message's number in the bag, from 1.
    pub(super) number: usize,
    /// Its header's time; the time of its recording where nobody has set that. Seconds.
    pub(super) at_s: f64,
    pub(super) message: Message,
}

/// What a bag holds.
#[derive(Debug, Default)]
pub(super) struct Bag {
    pub(super) entries: Vec<Entry>,
    /// Topics of other types, each with its type.
    pub(super) others: BTreeSet<String>,
    pub(super) messages: usize,
    /// False if the end of a file is missing.
    pub(super) is_whole: bool,
    pub(super) remarks: Vec<String>,
    /// The number of the last message before the first damage that has more behind it.
    pub(super) torn_after: Option<usize>,
    /// How many messages are not of their type, and the first of them in words.
    unread: Option<(u64, String)>,
    /// The name of the file in a folder, for remarks; empty where the bag is a file.
    part: String,
}

/// Larger files are refused, bytes.
const MAX_BYTES: u64 = 4 << 30;
/// The same of what zstd has compressed, and of standard input: nobody sees how large they are.
const MAX_STREAM_BYTES: u64 = 1 << 30;
/// So many bytes tell a bag from other files.
const PROBE: u64 = 16;
/// The name of standard input.
const STANDARD_INPUT: &str = "/dev/stdin";
/// A larger message is not unpacked, bytes.
const MAX_MESSAGE_BYTES: u64 = 64 << 20;
/// How zstd's files and messages begin.
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

impl Bag {
    /// Reads a file or a folder.
    ///
    /// # Errors
    /// When it cannot be read, or is no bag.
    pub(super) fn read(path: &Path) -> Result<Self, ImportError> {
        let mut bag = Self { is_whole: true, ..Self::default() };
        if path == Path::new(STANDARD_INPUT) {
            bag.all(io::stdin().lock(), path, MAX_STREAM_BYTES)?;
            return Ok(bag);
        }
        for file in files(path)? {
            let name = file.file_name().filter(|_| file != path).unwrap_or_default().display().to_string();
            bag.part = if name.is_empty() { name } else { format!("{name}: ") };
            bag.file(&file)?;
        }
        Ok(bag)
    }

    fn file(&mut self, path: &Path) -> Result<(), ImportError> {
        let name = path.display().to_string();
        let io = |source| ImportError::Io { file: name.clone(), source };
        self.all(regular::open(path).map_err(io)?, path, MAX_BYTES)
    }

    /// Takes a bag of at most so many bytes. What is none is not read to its end.
    fn all(&mut self, input: impl Read, path: &Path, most: u64) -> Result<(), ImportError> {
        let io = |source| ImportError::Io { file: path.display().to_string(), source };
        let mut bytes = begin_and_rest(input, path, most).map_err(|error| error.unwrap_or_else(io))?;
        if bytes.starts_with(ZSTD) {
            let damaged = |_| {
                let limit = MAX_STREAM_BYTES >> 30;
                let text = format!(
                    "compressed with zstd, but damaged, cut off, or more than {limit} GiB: unpack it with `unzstd`"
                );
                problem(path, &text)
            };
            let decoder = zstd::stream::read::Decoder::new(bytes.as_slice()).map_err(damaged)?;
            bytes = begin_and_rest(decoder, path, MAX_STREAM_BYTES).map_err(|error| error.unwrap_or_else(damaged))?;
        }
        if bytes.starts_with(mcap::MAGIC) { self.mcap(&bytes, path) } else { self.sqlite(&bytes, path) }?;
        self.check_unread(path)
    }

    fn take(&mut self, topic: &str, kind: Kind, logged_s: f64, data: &[u8]) {
        // A bag whose messages are compressed one by one.
        let unpacked = if data.starts_with(ZSTD) { unpacked(data, MAX_MESSAGE_BYTES) } else { None };
        let Some((stamp_s, message)) = kind.read(unpacked.as_deref().unwrap_or(data)) else {
            let number = self.messages;
            let first = || (0, format!("message {number}, topic {topic}: its bytes are no {kind:?} message in CDR"));
            self.unread.get_or_insert_with(first).0 += 1;
            return;
        };
        let at_s = if stamp_s > 0.0 { stamp_s } else { logged_s };
        self.entries.push(Entry { topic: topic.into(), number: self.messages, at_s, message });
    }

    fn mcap(&mut self, bytes: &[u8], path: &Path) -> Result<(), ImportError> {
        let (mut schemas, mut channels, first) = (BTreeMap::new(), BTreeMap::new(), self.messages);
        let take = |record: Record<'_>| {
            match record {
                Record::Header(header) if header.profile == "slamd" => {
                    return Err(problem(path, "a capture of slamd: `slamd replay` runs it"));
                }
                Record::Schema { header, .. } => drop(schemas.insert(header.id, header.name)),
                Record::Channel(channel) => {
                    let kind = schemas.get(&channel.schema_id).and_then(|name| Kind::of(name));
                    if kind.is_none() {
                        let name = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                        self.others.insert(format!("{} ({name})", channel.topic));
                    }
                    channels.insert(channel.id, (channel.topic, kind));
                }
                Record::Message { header, data } => {
                    self.messages += 1;
                    if let Some((topic, Some(kind))) = channels.get(&header.channel_id) {
                        self.take(topic, *kind, 1e-9 * header.log_time as f64, &data);
                    }
                }
                _ => {}
            }
            Ok(())
        };
        let losses = mcap_file::read(bytes, take, |compression| {
            let text = format!(
                "its chunks are compressed with {compression}: rewrite it with `mcap compress --compression none`"
            );
            problem(path, &text)
        })?;
        let whole = losses.before_first().and_then(|count| usize::try_from(count).ok());
        self.torn_after = self.torn_after.or_else(|| whole.map(|count| first + count));
        self.lose(losses.sentences());
        Ok(())
    }

    /// Parts of the file cannot be read.
    fn lose(&mut self, sentences: Vec<String>) {
        self.is_whole &= sentences.is_empty();
        let part = &self.part;
        self.remarks.extend(sentences.iter().map(|sentence| format!("{part}{sentence}")));
    }

    /// Messages that are not of their type: a few are damage, all are another encoding.
    fn check_unread(&mut self, path: &Path) -> Result<(), ImportError> {
        let Some((count, first)) = self.unread.take() else { return Ok(()) };
        if self.entries.is_empty() {
            return Err(problem(path, &first));
        }
        self.lose(vec![format!("{first}; {count} such messages are left out")]);
        Ok(())
    }

    fn sqlite(&mut self, bytes: &[u8], path: &Path) -> Result<(), ImportError> {
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        if std::fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
            return Err(problem(
                path,
                "its recorder was killed, and a part is still in the file -wal: open it once with `sqlite3 FILE .tables`",
            ));
        }
        let damaged = || {
            problem(
                path,
                "no ROS 2 bag, or one too damaged to be read: its tables topics and messages are not there; try `sqlite3 FILE .recover | sqlite3 NEW.db3`",
            )
        };
        let database = Database::new(bytes).ok_or_else(damaged)?;
        let (topics, _) = database.table("topics", &["id", "name", "type"]).ok_or_else(damaged)?;
        let (mut messages, lost) =
            database.table("messages", &["topic_id", "timestamp", "data"]).ok_or_else(damaged)?;
        let stamp = |row: &Vec<Value>| if let Some(Value::Whole(ns)) = row.get(1) { *ns } else { 0 };
        messages.sort_by_key(stamp);
        self.lose(lost.sentences(&messages.iter().map(stamp).collect::<Vec<_>>()));
        let mut kinds = BTreeMap::new();
        for row in topics {
            let [Value::Whole(id), name, kind] = row.as_slice() else { return Err(damaged()) };
            if Kind::of(&kind.text()).is_none() {
                self.others.insert(format!("{} ({})", name.text(), kind.text()));
            }
            kinds.insert(*id, (name.text(), Kind::of(&kind.text())));
        }
        for row in messages {
            self.messages += 1;
            let [Value::Whole(topic), Value::Whole(ns), Value::Bytes(data)] = row.as_slice() else {
                continue;
            };
            if let Some((topic, Some(kind))) = kinds.get(topic) {
                self.take(topic, *kind, 1e-9 * *ns as f64, data);
            }
        }
        Ok(())
    }
}

/// The file, or those of a folder in the order of their names.
fn files(path: &Path) -> Result<Vec<PathBuf>, ImportError> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let io = |source| ImportError::Io { file: path.display().to_string(), source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(io)? {
        let file = entry.map_err(io)?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_bag = [".mcap", ".db3"].iter().any(|end| name.trim_end_matches(".zstd").ends_with(end));
        if is_bag {
            files.push(file);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(problem(path, "a folder without *.mcap or *.db3: name a ROS 2 bag"));
    }
    Ok(files)
}

/// Why a bag's bytes cannot be had.
enum Unread {
    Read(io::Error),
    Unfit(ImportError),
}

impl Unread {
    fn unwrap_or_else(self, read: impl FnOnce(io::Error) -> ImportError) -> ImportError {
        match self {
            Self::Read(error) => read(error),
            Self::Unfit(error) => error,
        }
    }
}

/// The bytes of a bag or a file of zstd, at most so many. Others are named by their begin.
fn begin_and_rest(mut input: impl Read, path: &Path, most: u64) -> Result<Vec<u8>, Unread> {
    let mut bytes = Vec::new();
    input.by_ref().take(PROBE).read_to_end(&mut bytes).map_err(Unread::Read)?;
    check_begin(&bytes, path).map_err(Unread::Unfit)?;
    input.take((most + 1).saturating_sub(PROBE)).read_to_end(&mut bytes).map_err(Unread::Read)?;
    if bytes.len() as u64 > most {
        let text = format!("more than {} GiB: split the bag, or keep the topics that are needed", most >> 30);
        return Err(Unread::Unfit(problem(path, &text)));
    }
    Ok(bytes)
}

/// Names what begins as no bag does.
fn check_begin(begin: &[u8], path: &Path) -> Result<(), ImportError> {
    let is_bag = begin.starts_with(mcap::MAGIC) || begin.starts_with(b"SQLite format 3\0");
    match () {
        () if is_bag || begin.starts_with(ZSTD) => Ok(()),
        () if begin.is_empty() => Err(ImportError::Foreign { file: path.display().to_string(), what: "empty" }),
        () if begin.starts_with(b"#ROSBAG V") => {
            Err(problem(path, "a ROS 1 bag: convert it with `rosbags-convert --src FILE --dst FOLDER`"))
        }
        () => Err(problem(path, "no ROS 2 bag: it is neither MCAP nor SQLite")),
    }
}

/// The content of what zstd has compressed; none if it is damaged or larger than `most` bytes.
fn unpacked(bytes: &[u8], most: u64) -> Option<Vec<u8>> {
    let mut unpacked = Vec::new();
    let mut reader = zstd::stream::read::Decoder::new(bytes).ok()?.take(most + 1);
    reader.read_to_end(&mut unpacked).ok()?;
    (unpacked.len() as u64 <= most).then_some(unpacked)
}

fn problem(path: &Path, problem: &str) -> ImportError {
    ImportError::Problem { file: path.display().to_string(), problem: problem.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(path: &Path) -> String {
        Bag::read(path).unwrap_err().to_string()
    }

    #[test]
    fn what_is_no_bag_is_named_and_not_read() {
        assert_eq!(error(Path::new("/dev/zero")), "/dev/zero: it is a device, not a file");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        std::fs::write(&path, b"").unwrap();
        assert_eq!(error(&path), format!("{} is empty", path.display()));
        // A hundred gigabytes without a byte on the disk.
        std::fs::File::create(&path).unwrap().set_len(100 << 30).unwrap();
        assert!(error(&path).ends_with("no ROS 2 bag: it is neither MCAP nor SQLite"));
    }

    #[test]
    fn streams_and_bombs_stop_at_the_bound() {
        let path = Path::new("a.mcap");
        let read = |input: &mut dyn Read| match begin_and_rest(input, path, 1 << 20) {
            Err(Unread::Unfit(error)) => error.to_string(),
            other => panic!("{:?}", other.map(|bytes| bytes.len()).ok()),
        };
        let text = read(&mut mcap::MAGIC.chain(io::repeat(0)));
        assert!(text.starts_with("a.mcap: more than 0 GiB: split the bag"), "{text}");
        assert!(read(&mut io::repeat(0)).contains("no ROS 2 bag"));
        let bomb = zstd::stream::encode_all(io::repeat(0).take(1 << 30), 1).unwrap();
        let mut bag = Bag::default();
        let text = bag.all(bomb.as_slice(), path, MAX_BYTES).unwrap_err().to_string();
        assert!(text.contains("no ROS 2 bag"), "{text}");
    }

    #[test]
    fn a_bag_that_is_cut_off_names_its_file_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.mcap");
        std::fs::write(&path, mcap::MAGIC).unwrap();
        let said = |path: &Path| Bag::read(path).unwrap().remarks.join("\n");
        assert!(said(&path).starts_with("cut off: it ends 0.0 s after"), "{}", said(&path));
        assert!(said(folder.path()).starts_with("cut.mcap: cut off: it ends"), "{}", said(folder.path()));
    }
}
