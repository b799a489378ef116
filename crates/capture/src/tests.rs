use super::records::MAX_INDEXED_CHUNKS;
use super::*;
use slamd_core::{Pose2, Timestamp};
use std::fs;
use std::path::Path;

fn us(us: u64) -> Timestamp {
    Timestamp::from_us(us)
}

fn info() -> CaptureInfo {
    CaptureInfo {
        slamd_version: "0.1.0".into(),
        protocol_version: "1.0".into(),
        config_toml: "method = \"walls\"\n".into(),
        unix_zero_us: Some(1_700_000_000_000_000),
        notes: "a test".into(),
        faults: Some(vec!["7:saturated@30s".into(), "9:noisy@0s".into()]),
    }
}

/// Records at intervals of 30 ms: each chunk holds three.
fn records(count: u64) -> Vec<Record> {
    (0..count)
        .map(|i| {
            let at = us(i * 30_000);
            let bytes: Vec<u8> = (0..i % 40).map(|b| (b * 37 + i).to_le_bytes()[0]).collect();
            match i % 3 {
                0 if bytes.is_empty() => Record::Opened { at },
                0 => Record::Received { at, bytes },
                1 => Record::Sent { at, bytes },
                _ => Record::Truth { at, pose: Pose2 { x_m: 0.1 * i as f64, y_m: -0.7, theta_rad: 1.0 / 3.0 } },
            }
        })
        .collect()
}

fn append(writer: &mut CaptureWriter, record: &Record) {
    writer.record(record).unwrap();
}

fn write(path: &Path, records: &[Record]) {
    let mut writer = CaptureWriter::create(path, &info()).unwrap();
    records.iter().for_each(|record| append(&mut writer, record));
    writer.finish().unwrap();
}

fn read(path: &Path) -> (Vec<Record>, CaptureReader) {
    let mut reader = CaptureReader::open(path).unwrap();
    let records = reader.by_ref().map(Result::unwrap).collect();
    (records, reader)
}

#[test]
fn a_capture_is_read_back_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.mcap");
    write(&path, &records(100));
    let (back, reader) = read(&path);
    assert_eq!(back, records(100));
    assert_eq!((reader.info(), reader.damage()), (&info(), None));
}

#[test]
fn other_mcap_readers_open_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.mcap");
    write(&path, &records(10));
    let file = fs::read(&path).unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap).collect();
    assert_eq!(messages.len(), 10);
    assert_eq!(messages[1].log_time, 30_000_000);
    let truth = &messages[2].channel;
    assert_eq!((truth.topic.as_str(), truth.message_encoding.as_str()), ("/truth/pose", "json"));
    assert_eq!(truth.schema.as_ref().unwrap().encoding, "jsonschema");
    let summary = mcap::Summary::read(&file).unwrap().unwrap();
    assert_eq!(summary.metadata_indexes[0].name, "slamd");
    assert_eq!(summary.chunk_indexes.len(), 1 + 4, "one chunk of channels, then 3 + 3 + 3 + 1 messages");
}

#[test]
fn a_long_capture_is_read_without_an_index_and_keeps_no_memory_of_its_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.mcap");
    // Each record closes the chunk of the one before; the first chunk holds the topics.
    for (count, indexed) in [(MAX_INDEXED_CHUNKS - 1, MAX_INDEXED_CHUNKS), (MAX_INDEXED_CHUNKS, 0)] {
        let all: Vec<Record> =
            (0..count as u64).map(|i| Record::Received { at: us(i * 100_000), bytes: vec![1] }).collect();
        write(&path, &all);
        let file = fs::read(&path).unwrap();
        let summary = mcap::Summary::read(&file).unwrap().unwrap();
        assert_eq!(summary.chunk_indexes.len(), indexed);
        let statistics = summary.stats.unwrap();
        assert_eq!((statistics.message_count, u64::from(statistics.chunk_count)), (count as u64, count as u64 + 1));
        let messages = mcap::MessageStream::new(&file).unwrap();
        assert_eq!(messages.map(Result::unwrap).count(), count);
        let (back, reader) = read(&path);
        assert!(back == all && reader.damage().is_none(), "{:?}", reader.damage());
    }
}

#[test]
fn an_hour_more_takes_no_more_memory() {
    let mut writer = CaptureWriter::begin(std::io::sink(), Path::new("sink"), &info()).unwrap();
    let mut hour = |hour: u64| {
        let mut at = (36_000 * hour..36_000 * (hour + 1)).map(|i| us(i * 100_000));
        allocation_counter::measure(|| at.by_ref().for_each(|at| writer.received(at, &[7; 100]).unwrap())).bytes_current
    };
    hour(0);
    let grown_bytes = hour(1);
    assert!(grown_bytes < 1_024, "{grown_bytes}");
}

/// The records of a whole file, as another reader sees them, checksums checked.
#[test]
fn every_checksum_and_offset_of_the_file_is_right() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.mcap");
    write(&path, &records(100));
    let file = fs::read(&path).unwrap();
    let options = mcap::sans_io::LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = mcap::sans_io::LinearReader::new_with_options(options);
    let (mut rest, mut messages) = (file.as_slice(), 0);
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            mcap::sans_io::LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            mcap::sans_io::LinearReadEvent::Record { opcode, .. } => {
                messages += usize::from(opcode == mcap::records::op::MESSAGE);
            }
        }
    }
    assert_eq!(messages, 100);
    let summary = mcap::Summary::read(&file).unwrap().unwrap();
    // The first has the topics alone.
    let indexed: usize = summary
        .chunk_indexes
        .iter()
        .skip(1)
        .map(|chunk| {
            let by_channel = summary.read_message_indexes(&file, chunk).unwrap();
            let is_right = |entry: &&_| summary.seek_message(&file, chunk, entry).is_ok();
            by_channel.values().flatten().filter(is_right).count()
        })
        .sum();
    assert_eq!(indexed, 100);
    let metadata = summary.metadata_indexes.iter().map(|index| mcap::read::metadata(&file, index).unwrap());
    assert!(metadata.map(|metadata| metadata.name).eq(["slamd", "slamd"]));
}

#[test]
fn a_file_cut_at_any_byte_of_its_last_64_kib_keeps_every_chunk_closed_before_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mcap");
    let all = records(500);
    write(&whole, &all);
    let file = fs::read(&whole).unwrap();
    assert!(file.len() > 65_536, "{} bytes", file.len());
    let ends: Vec<u64> = mcap::Summary::read(&file)
        .unwrap()
        .unwrap()
        .chunk_indexes
        .iter()
        .map(|chunk| chunk.chunk_start_offset + chunk.chunk_length)
        .collect();
    for length in file.len() - 65_536..file.len() {
        let mut reader = CaptureReader::begin(&file[..length], &whole).unwrap();
        let chunks = ends.iter().filter(|&&end| end <= length as u64).count();
        let kept = &all[..(3 * chunks.saturating_sub(1)).min(all.len())];
        assert!(reader.by_ref().map(Result::unwrap).eq(kept.iter().cloned()), "cut at {length}");
        assert!(reader.damage().unwrap().contains("was not finished"), "cut at {length}");
    }
}

/// Where each chunk begins.
fn starts(file: &[u8]) -> Vec<usize> {
    let chunks = mcap::Summary::read(file).unwrap().unwrap().chunk_indexes;
    chunks.iter().map(|chunk| chunk.chunk_start_offset.try_into().unwrap()).collect()
}

/// True if `held` is `all` but for some records in one piece; how many.
fn missing(all: &[Record], held: &[Record]) -> Option<usize> {
    let front = all.iter().zip(held).take_while(|(all, held)| all == held).count();
    let lost = all.len().checked_sub(held.len())?;
    (all[front + lost..] == held[front..]).then_some(lost)
}

#[test]
fn a_damaged_byte_costs_its_chunk_alone_and_never_panics_or_invents_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mcap");
    let all = records(20);
    write(&path, &all);
    let file = fs::read(&path).unwrap();
    // Topics, and the description with its copy, come in pieces of their own.
    let first = starts(&file)[0];
    for position in 8..file.len() {
        for bit in 0..8 {
            let mut damaged = file.clone();
            damaged[position] ^= 1 << bit;
            let Ok(mut reader) = CaptureReader::begin(damaged.as_slice(), &path) else {
                panic!("bit {bit} of byte {position}: it cannot be read");
            };
            assert_eq!(reader.info(), &info(), "bit {bit} of byte {position}");
            let held: Vec<Record> = reader.by_ref().flatten().collect();
            let lost = missing(&all, &held).unwrap_or_else(|| panic!("bit {bit} of byte {position}: {held:?}"));
            assert!(
                lost <= if position < first { 2 * 3 } else { 3 },
                "bit {bit} of byte {position}: {lost} records are lost: {:?}",
                reader.damage()
            );
            assert!(lost == 0 || reader.damage().is_some(), "bit {bit} of byte {position}: silent");
        }
    }
}

#[test]
fn a_page_of_zeros_at_the_head_costs_the_chunks_that_it_hits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mcap");
    let all = records(600);
    write(&path, &all);
    let file = fs::read(&path).unwrap();
    let chunks = starts(&file);
    for length in [20, chunks[0], chunks[3], chunks[9]] {
        let mut damaged = file.clone();
        damaged[8..length].fill(0);
        let mut reader = CaptureReader::begin(damaged.as_slice(), &path).unwrap();
        assert_eq!(reader.info(), &info());
        let held: Vec<Record> = reader.by_ref().map(Result::unwrap).collect();
        let hit = chunks.iter().filter(|start| **start < length).count();
        let lost = missing(&all, &held).unwrap();
        assert!(lost <= 3 * (hit + 1), "{length}: {lost}");
        assert!(reader.damage().unwrap().starts_with("the file is damaged after 0.000 s ("), "{:?}", reader.damage());
    }
}

#[test]
fn each_damage_is_counted_and_all_that_is_sound_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mcap");
    let all = records(600);
    write(&path, &all);
    let mut file = fs::read(&path).unwrap();
    let chunks = starts(&file);
    // A checksum, a length that swallows the rest, a page of zeros, and an end that is cut.
    file[chunks[10] + 60] ^= 1;
    file[chunks[50] + 4] ^= 1;
    file[chunks[90]..][..100].fill(0);
    file.truncate(chunks[150] + 20);
    let mut reader = CaptureReader::begin(file.as_slice(), &path).unwrap();
    let held: Vec<Record> = reader.by_ref().map(Result::unwrap).collect();
    // The first chunk has the topics; each other one has three records.
    let lost = |i: usize| [10, 50, 90].contains(&(1 + i / 3));
    let sound: Vec<_> = (0..149 * 3).filter(|i| !lost(*i)).map(|i| all[i].clone()).collect();
    assert_eq!(held.len(), sound.len());
    assert!(held == sound);
    let damage = reader.damage().unwrap();
    assert!(damage.starts_with("the file is damaged after 0.780 s ("), "{damage}");
    assert!(damage.contains(" and in 2 more places; ") && damage.contains("was not finished"), "{damage}");
}

#[test]
fn records_older_than_a_flush_period_are_on_disk_while_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("killed.mcap");
    let mut writer = CaptureWriter::create(&path, &info()).unwrap();
    let on_disk = || {
        let copy = folder.path().join("copy.mcap");
        fs::copy(&path, &copy).unwrap();
        let (records, reader) = read(&copy);
        assert_eq!(reader.info(), &info());
        records.len()
    };
    assert_eq!(on_disk(), 0);
    for record in records(3) {
        append(&mut writer, &record);
    }
    assert_eq!(on_disk(), 0, "0 to 60 ms: the chunk is open");
    writer.flush_if_due(us(79_999)).unwrap();
    assert_eq!(on_disk(), 0);
    writer.flush_if_due(us(80_000)).unwrap();
    assert_eq!(on_disk(), 3);
    writer.received(us(150_000), b"open").unwrap();
    writer.received(us(230_000), b"next").unwrap();
    assert_eq!(on_disk(), 4);
}

#[test]
fn times_that_run_back_are_refused_by_writer_and_reader() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("back.mcap");
    let mut writer = CaptureWriter::create(&path, &info()).unwrap();
    writer.received(us(2_000_000), b"a").unwrap();
    let error = writer.received(us(1_000_000), b"b").unwrap_err().to_string();
    assert!(error.ends_with("back.mcap: time runs back from 2.000000 s to 1.000000 s"), "{error}");
    drop(writer);

    let plain = mcap::WriteOptions::new().compression(None);
    let mut foreign = plain.create(fs::File::create(&path).unwrap()).unwrap();
    foreign.write_metadata(&info().to_metadata()).unwrap();
    let channel_id = foreign.add_channel(0, RECEIVED_TOPIC, "x", &BTreeMap::new()).unwrap();
    for log_time in [5_000_000_000, 4_000_000_000] {
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        foreign.write_to_known_channel(&header, b"").unwrap();
    }
    foreign.finish().unwrap();
    let results: Vec<_> = CaptureReader::open(&path).unwrap().collect();
    assert_eq!(results.len(), 2);
    assert!(results[1].as_ref().unwrap_err().to_string().contains("back.mcap: time runs back from 5.0"));
}

#[test]
fn a_file_that_is_no_capture_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notes.txt");
    fs::write(&path, "hello").unwrap();
    let error = CaptureReader::open(&path).err().unwrap().to_string();
    assert!(error.contains("notes.txt: not an MCAP file: it begins with 68 65 6c 6c 6f"), "{error}");
    // The recorder may be killed before its first byte is written.
    fs::write(&path, "").unwrap();
    let error = CaptureReader::open(&path).err().unwrap().to_string();
    assert!(error.ends_with("notes.txt is empty, and no capture"), "{error}");
    for cut in 1..8 {
        fs::write(&path, &mcap::MAGIC[..cut]).unwrap();
        let (records, reader) = read(&path);
        assert!(records.is_empty() && reader.damage().unwrap().contains("was not finished"));
    }
    let error = CaptureReader::open(&folder.path().join("absent")).err().unwrap().to_string();
    assert!(error.contains("absent: "), "{error}");
}

/// Writes an MCAP file of another program with one message on `topic`.
fn foreign(path: &Path, profile: &str, topic: &str) -> String {
    let options = mcap::WriteOptions::new().profile(profile).compression(None);
    let mut writer = options.create(fs::File::create(path).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, topic, "cdr", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"x").unwrap();
    writer.finish().unwrap();
    CaptureReader::open(path).err().unwrap().to_string()
}

#[test]
fn other_mcap_files_are_named_as_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    let error = foreign(&path, "ros2", "/scan");
    assert!(error.contains("bag.mcap is a ROS 2 bag (profile ros2), no capture of slamd: it has no /serial/rx; it may be what `slamd export`"), "{error}");
    assert!(foreign(&path, "px4", "/imu").contains("another program's MCAP file (profile px4)"));
    assert!(foreign(&path, "", "/imu").contains("another program's MCAP file (/imu)"));
    for profile in ["", "slamd", "ros2"] {
        let error = foreign(&path, profile, RECEIVED_TOPIC);
        assert!(error.contains("its metadata record `slamd` is missing"), "{error}");
    }
    // A recorder that was killed after the header.
    let mut writer = mcap::WriteOptions::new().profile("slamd").create(fs::File::create(&path).unwrap()).unwrap();
    writer.flush().unwrap();
    std::mem::forget(writer);
    assert!(read(&path).0.is_empty());
}

#[test]
fn a_damaged_head_without_a_copy_is_called_damaged_and_a_damaged_magic_refuses_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("older.mcap");
    let options = mcap::WriteOptions::new().profile("slamd").compression(None);
    let mut writer = options.create(fs::File::create(&path).unwrap()).unwrap();
    writer.write_metadata(&info().to_metadata()).unwrap();
    let channel_id = writer.add_channel(0, RECEIVED_TOPIC, "", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"x").unwrap();
    writer.finish().unwrap();
    assert_eq!(CaptureReader::open(&path).unwrap().info(), &info());
    let file = fs::read(&path).unwrap();
    // The first text of this kind is the profile.
    let name = file.windows(9).enumerate().filter(|(_, text)| text == b"\x05\0\0\0slamd").nth(1).unwrap().0 + 4;
    let magic = (0..8).map(|position| (position, "not an MCAP file"));
    let head = (name..name + 5).map(|position| (position, "the capture is damaged, or rewritten by another program"));
    for (position, words) in magic.chain(head) {
        // With bit 7 a name is no text, and its record is skipped as damaged.
        for bit in 0..7 {
            let mut damaged = file.clone();
            damaged[position] ^= 1 << bit;
            fs::write(&path, damaged).unwrap();
            let error = CaptureReader::open(&path).err().unwrap().to_string();
            assert!(error.contains(words), "bit {bit} of byte {position}: {error}");
        }
    }
}
