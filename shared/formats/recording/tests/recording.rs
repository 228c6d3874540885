//! Recordings are read as they were written, up to where they were cut, and damage is an error.

#![allow(clippy::unwrap_used)]

mod written;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use gyre_contract::{Item, MotionHeader, PoseHeader, RotationHeader};
use gyre_datasets::DatasetOptions;
use gyre_recording::{
    Head, Incoming, LogLine, Positions, Recording, RecordingWriter, Split, SplitWriter,
    file::McapFile, open, open_recording,
};
use mcap::records::{MessageHeader, Metadata, Record, op};
use written::{head, item, message};

const SCANS: u64 = 6;

fn scan(seq: u64) -> Incoming {
    written::scan(item(seq))
}

fn pose(seq: u64) -> Incoming {
    let header = PoseHeader {
        item: item(seq),
        x_m: seq as f64,
        ..PoseHeader::default()
    };
    Incoming {
        missed: 2,
        ..message("pose", &header)
    }
}

fn write(path: &Path, head: &Head, seqs: &[u64]) {
    let mut writer = RecordingWriter::create(path, head).unwrap();
    for seq in seqs {
        writer.add(&scan(*seq)).unwrap();
        writer.add(&pose(*seq)).unwrap();
        // A chunk for each, as after half a second.
        writer.flush().unwrap();
    }
    writer.add_log(LogLine::default()).unwrap();
    writer.finish().unwrap();
}

/// A recording of these scans and poses, and its folder.
fn recorded(seqs: &[u64]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    write(&path, &head("a", 1), seqs);
    (folder, path)
}

fn opened(path: &Path) -> Recording {
    Recording::open(&[path.to_owned()]).unwrap()
}

fn seqs(recording: &Recording, topic: &str) -> Vec<u64> {
    recording.entries(topic).map(|entry| entry.seq).collect()
}

/// The messages that can be read.
fn read_all(recording: &mut Recording) -> usize {
    let mut read = 0;
    for topic in ["scan", "pose"] {
        for seq in seqs(recording, topic) {
            read += usize::from(recording.read(topic, seq).is_ok());
        }
    }
    read
}

#[test]
fn messages_are_read_byte_for_byte_and_what_was_missed_is_known() {
    let (_folder, path) = recorded(&[0, 1, 2, 3, 4, 5]);
    let mut recording = opened(&path);
    assert_eq!(recording.head(), &head("a", 1));
    for seq in (0..SCANS).rev() {
        for message in [scan(seq), pose(seq)] {
            let stored = recording.read(message.topic, seq).unwrap();
            assert_eq!(stored.header, message.header);
            assert_eq!(stored.payload, message.payload);
        }
    }
    assert_eq!(recording.missed(), [("pose", 2 * SCANS)].into());
    let absent = recording.read("scan", SCANS);
    assert!(absent.unwrap_err().to_string().contains("missed it"));
    assert!(
        RecordingWriter::create(&path, &head("a", 1)).is_err(),
        "it is there"
    );
}

#[test]
fn a_dataset_has_the_recorded_scans_under_their_numbers_and_names_the_missing_ones() {
    let (_folder, path) = recorded(&[0, 1, 3]);
    let mut dataset = open(&path, &DatasetOptions::default()).unwrap();
    assert_eq!((dataset.first(), dataset.len()), (10, 14));
    let own = dataset.scan(11).unwrap();
    assert_eq!(own.geometry.range_offset_m, -0.25);
    assert_eq!(own.azimuth_rad[..4], [0.0, 1.5, 3.0, 4.5]);
    assert_eq!(own.view().row(2), &scan(1).payload[11 + 42..][..10]);
    let missing = dataset.scan(12).unwrap_err();
    assert!(missing.to_string().contains("has no scan 12"), "{missing}");
    let notes = dataset.notes().join(" ");
    assert!(notes.contains("1 of the scans 10 to 13"), "{notes}");
    for (offset_m, is_recorded) in [(-0.25, true), (0.0, false)] {
        let options = DatasetOptions {
            range_offset_m: Some(offset_m),
            ..DatasetOptions::default()
        };
        assert_eq!(open(&path, &options).is_ok(), is_recorded);
    }
}

#[test]
fn parts_of_one_recording_are_one_and_one_of_another_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let [first, foreign, third, fourth] =
        ["a.mcap", "a.2.mcap", "a.3.mcap", "a.4.mcap"].map(|name| folder.path().join(name));
    write(&first, &head("a", 1), &[0, 1]);
    write(&foreign, &head("b", 2), &[2, 9]);
    // A message again, which the killed recorder may have written too.
    write(&third, &head("a", 3), &[1, 3]);
    write(&fourth, &head("a", 4), &[4, 5]);
    let mut recording = open_recording(&first).unwrap();
    assert_eq!(seqs(&recording, "scan"), [0, 1, 3, 4, 5]);
    assert_eq!(read_all(&mut recording), 10);
    assert_eq!(recording.left_out(), [foreign]);
    assert_eq!(recording.absent_parts(), [2]);
    let paths: Vec<&Path> = recording.paths().collect();
    assert_eq!(paths, [&first, &third, &fourth]);
    assert_eq!(recording.missed(), [("pose", 12)].into());
}

/// The pose of a scan may come when later scans are long there: it must not count as the start of
/// a part, or each part would be over at once.
#[test]
fn a_part_is_as_long_as_it_is_to_be_although_poses_lag_behind_the_scans() {
    const LAG: u64 = 4;
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("drive.mcap");
    let split = Split {
        span_ns: Some(750_000_000),
        ..Split::default()
    };
    let mut writer =
        SplitWriter::create(to.clone(), head("a", 1), split, None, Positions::new()).unwrap();
    for seq in 0..12_u64 {
        if let Some(behind) = seq.checked_sub(LAG) {
            writer.add(&pose(behind)).unwrap();
        }
        writer.add(&scan(seq)).unwrap();
    }
    writer.file.finish().unwrap();
    // Of three or four scans.
    assert_eq!(gyre_recording::parts(&to).len(), 4);
}

#[test]
fn a_part_ends_at_its_size_and_each_message_is_in_one_part() {
    const COUNT: u64 = 2 * SCANS;
    let folder = tempfile::tempdir().unwrap();
    let of_two = folder.path().join("of_two.mcap");
    let mut writer = RecordingWriter::create(&of_two, &head("a", 1)).unwrap();
    for seq in 0..2 {
        writer.add(&scan(seq)).unwrap();
        writer.add(&pose(seq)).unwrap();
        writer.flush().unwrap();
    }
    let bytes = fs::metadata(&of_two).unwrap().len();
    let split = Split {
        bytes: Some(bytes),
        ..Split::default()
    };
    let to = folder.path().join("drive.mcap");
    let mut writer =
        SplitWriter::create(to.clone(), head("a", 1), split, None, Positions::new()).unwrap();
    for seq in 0..COUNT {
        writer.add(&scan(seq)).unwrap();
        writer.add(&pose(seq)).unwrap();
        writer.file.flush().unwrap();
    }
    writer.file.finish().unwrap();
    let parts = gyre_recording::parts(&to);
    // Of two scans each, or three where they are compressed better.
    assert!(parts.len() as u64 >= COUNT / 3, "{parts:?}");
    for part in &parts[..parts.len() - 1] {
        assert!(fs::metadata(part).unwrap().len() >= bytes);
    }
    for topic in ["scan", "pose"] {
        let of_parts = parts.iter().flat_map(|part| seqs(&opened(part), topic));
        assert!(of_parts.eq(0..COUNT), "{topic}");
    }
    for part in &parts {
        let mut alone = opened(part);
        assert_eq!(alone.damages().count(), 0, "{}", part.display());
        let there = seqs(&alone, "scan").len() + seqs(&alone, "pose").len();
        assert_eq!(read_all(&mut alone), there);
    }
}

#[test]
fn of_a_ring_of_parts_the_newest_are_kept_and_the_files_of_others() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("drive.mcap");
    let other = folder.path().join("drive.2.mcap");
    let other_part = RecordingWriter::create(&other, &head("b", 2)).unwrap();
    other_part.finish().unwrap();
    let split = Split {
        span_ns: Some(250_000_000),
        keep_bytes: Some(1),
        ..Split::default()
    };
    let positions = Positions::new();
    let mut writer = SplitWriter::create(to.clone(), head("a", 1), split, None, positions).unwrap();
    for seq in 0..12 {
        writer.add(&scan(seq)).unwrap();
    }
    let newest = writer.file.path.clone();
    writer.file.finish().unwrap();
    assert_eq!(gyre_recording::parts(&to), [other, newest.clone()]);
    assert_eq!(seqs(&opened(&newest), "scan").last(), Some(&11));
}

/// A message of a generation that gives numbers from `numbered_from` on; `scan` distinguishes it
/// from others of its number.
fn of(generation: u32, numbered_from: u64, seq: u64, scan: u64) -> Incoming {
    let header = MotionHeader {
        item: Item {
            generation,
            numbered_from,
            scan,
            previous_scan: scan,
            ..item(seq)
        },
        ..MotionHeader::default()
    };
    message("motion", &header)
}

#[test]
fn a_number_that_was_given_anew_has_its_newest_message() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a.mcap", "a.2.mcap"].map(|name| folder.path().join(name));
    let head = |part| Head {
        topics: ["motion", "rotation"].map(str::to_owned).to_vec(),
        ..head("a", part)
    };
    let rotation = |message: Incoming| Incoming {
        topic: "rotation",
        header: message.header[..size_of::<RotationHeader>()].to_vec(),
        ..message
    };
    let mut first = RecordingWriter::create(&paths[0], &head(1)).unwrap();
    // In one chunk: masking was killed when item 1 was the newest with a pose.
    for (seq, scan) in [(0, 10), (1, 11), (2, 12), (3, 13)] {
        first.add(&of(1, 0, seq, scan)).unwrap();
        first.add(&rotation(of(1, 0, seq, scan))).unwrap();
    }
    for (seq, scan) in [(1, 11), (2, 14), (3, 15), (4, 16)] {
        first.add(&of(2, 2, seq, scan)).unwrap();
    }
    first.finish().unwrap();
    // The run was started again, when item 3 was.
    let mut second = RecordingWriter::create(&paths[1], &head(2)).unwrap();
    second.add(&of(3, 4, 5, 18)).unwrap();
    second.finish().unwrap();
    let mut recording = Recording::open(&paths).unwrap();
    let scans = |recording: &Recording, topic| -> Vec<(u64, u64)> {
        let entries = recording.entries(topic);
        entries.map(|entry| (entry.seq, entry.scan)).collect()
    };
    assert_eq!(
        scans(&recording, "motion"),
        [(0, 10), (1, 11), (2, 14), (3, 15), (5, 18)]
    );
    // What another topic has of a void item is void too.
    assert_eq!(scans(&recording, "rotation"), [(0, 10), (1, 11)]);
    let stored = recording.read("motion", 2).unwrap();
    assert_eq!(stored.header, of(2, 2, 2, 14).header);
    let absent = recording.read("motion", 4);
    assert!(absent.unwrap_err().to_string().contains("missed it"));
}

#[test]
fn a_file_that_is_cut_anywhere_is_read_up_to_its_last_table() {
    let (_folder, path) = recorded(&[0, 1, 2, 3, 4, 5]);
    let bytes = fs::read(&path).unwrap();
    let mut most = 0;
    for length in (0..bytes.len()).step_by(97) {
        fs::write(&path, &bytes[..length]).unwrap();
        if let Ok(mut recording) = Recording::open(std::slice::from_ref(&path)) {
            let entries = seqs(&recording, "scan").len() + seqs(&recording, "pose").len();
            assert_eq!(read_all(&mut recording), entries, "{length} bytes");
            assert!(entries >= most);
            most = entries;
        }
    }
    assert_eq!(most, 2 * SCANS as usize);
}

#[test]
fn whatever_is_damaged_of_a_chunk_its_scan_alone_cannot_be_read_and_the_place_is_named() {
    let (_folder, path) = recorded(&[0, 1, 2, 3, 4, 5]);
    let whole = fs::read(&path).unwrap();
    let mut file = McapFile::open(&path).unwrap();
    let mut chunks = Vec::new();
    while let Some((opcode, span)) = file.next_record().unwrap() {
        chunks.extend((opcode == op::CHUNK).then_some(span.offset as usize));
    }
    // The first one has the channels alone, which the end of the file lists too.
    for (chunk, read) in [(0, 6), (3, 5), (6, 5)] {
        let at = chunks[chunk];
        let flips = (0..72).map(|bit| {
            let mut edited = whole.clone();
            edited[at + bit / 8] ^= 1 << (bit % 8);
            edited
        });
        let (before, after) = whole.split_at(at + 20);
        for edited in flips.chain([[before, &[7], after].concat()]) {
            fs::write(&path, edited).unwrap();
            let mut dataset = open(&path, &DatasetOptions::default()).unwrap();
            let damage = dataset.damage().unwrap().to_owned();
            assert!(damage.contains("is damaged at byte"), "{damage}");
            assert!(dataset.notes().join(" ").contains(&damage));
            assert_eq!((dataset.first(), dataset.len()), (10, 16));
            let scans = dataset.scans().filter(|scan| dataset.scan(*scan).is_ok());
            assert_eq!(scans.count(), read, "{damage}");
        }
    }
    fs::write(&path, &whole[..chunks[4] + 9]).unwrap();
    let damage = open_recording(&path).unwrap().damage().unwrap();
    let named = format!("has no end behind byte {}", chunks[4]);
    assert!(damage.contains(&named), "{damage}");
}

/// Writes a recording of one chunk, whose table is `table`, with `messages` messages of 1 MB.
fn write_chunk(path: &Path, table: BTreeMap<String, String>, messages: u32) {
    let head = path.with_extension("head");
    let _ = fs::remove_file(&head);
    RecordingWriter::create(&head, &written::head("a", 1))
        .unwrap()
        .finish()
        .unwrap();
    let head = fs::read(head).unwrap();
    let mut records = mcap::read::LinearReader::new(&head).unwrap();
    let head = records.find_map(|record| match record.unwrap() {
        Record::Metadata(head) => Some(head),
        _ => None,
    });
    let options = mcap::WriteOptions::new().chunk_size(None);
    let mut writer = options.create(fs::File::create(path).unwrap()).unwrap();
    writer.write_metadata(&head.unwrap()).unwrap();
    let channel = writer.add_channel(0, "/gyre/scan", "gyre", &BTreeMap::new());
    let mut header = MessageHeader {
        channel_id: channel.unwrap(),
        sequence: 0,
        log_time: 0,
        publish_time: 0,
    };
    for sequence in 0..messages {
        header.sequence = sequence;
        let message = vec![0; 1 << 20];
        writer.write_to_known_channel(&header, &message).unwrap();
    }
    writer.flush().unwrap();
    let name = "gyre.table".to_owned();
    let metadata = Metadata {
        name,
        metadata: table,
    };
    writer.write_metadata(&metadata).unwrap();
    writer.finish().unwrap();
}

#[test]
fn a_chunk_of_which_a_few_bytes_are_gigabytes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let table = || [("scan".to_owned(), "0:0:1".to_owned())].into();
    write_chunk(&path, table(), 4);
    assert_eq!(opened(&path).damage(), None);
    write_chunk(&path, table(), 300);
    assert!(fs::metadata(&path).unwrap().len() < 100_000);
    let refused = opened(&path).read("scan", 0).unwrap_err().to_string();
    assert!(
        refused.contains("a.mcap is damaged at byte") && refused.contains("exceeds limit"),
        "{refused}"
    );
}

#[test]
fn the_name_of_a_topic_is_not_kept_for_each_of_its_messages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    // A million messages with a name of 1 MB would be a terabyte.
    let rows: String = (0..1_000_000).map(|seq| format!("{seq}:0:1 ")).collect();
    let topic = "t".repeat(1 << 20);
    write_chunk(&path, [(topic.clone(), rows)].into(), 1);
    assert_eq!(opened(&path).entries(&topic).count(), 1_000_000);
}
