//! Bags that are written, read, cut and damaged. One program, so that all of it is linked once.
#![allow(clippy::unwrap_used)]

mod damage;
mod drivers;
mod messages;
mod samples;
#[path = "../../../ros2-messages/tests/turn.rs"]
mod turn;

use std::{
    fs,
    path::{Path, PathBuf},
};

use gyre_colossus::Configuration;
use gyre_datasets::{Dataset, DatasetOptions, Format, OpenError};
use gyre_geometry::OwnedScan;
use gyre_recording::bags::{BagWriter, Kept, is_bag, open};
use gyre_ros2_messages::{
    Ros2Message, decode, encode,
    messages::RadarFftDataMessage,
    nav_msgs::Odometry,
    navtech_msgs::{RadarBScanMsg, RadarFftDataMsg},
    radar::ScanMessages,
};
use mcap::{Compression, WriteOptions};
use messages::Messages;
use turn::{AZIMUTHS, BINS, START_NS, TURN_NS, radar, scan};

const B_SCANS: &str = "/radar_data/b_scan_msg";
const AZIMUTH_DATA: &str = "/radar_data/fft_data";
const CONFIGURATION: &str = "/radar_data/configuration_data";

fn b_scans(turns: usize) -> Messages {
    let (writer, mut messages) = (ScanMessages::new(radar(), "radar"), Messages::default());
    messages.add(CONFIGURATION, START_NS, &writer.configuration(START_NS));
    for turn in 0..turns {
        let end_ns = START_NS + TURN_NS * (turn as i64 + 1);
        messages.add(B_SCANS, end_ns, &writer.b_scan(scan(turn).view()));
    }
    messages
}

/// Azimuth by azimuth; `each` may change one, or leave it out.
fn azimuths(
    turns: usize,
    mut each: impl FnMut(usize, usize, RadarFftDataMsg) -> Option<RadarFftDataMsg>,
) -> Messages {
    let (mut writer, mut messages) = (ScanMessages::new(radar(), "radar"), Messages::default());
    messages.add(CONFIGURATION, START_NS, &writer.configuration(START_NS));
    for turn in 0..turns {
        let scan = scan(turn);
        for (row, message) in writer.azimuths(scan.view()).enumerate() {
            let log_ns = message.header.stamp.ns();
            if let Some(message) = each(turn, row, message) {
                messages.add(AZIMUTH_DATA, log_ns, &message);
            }
        }
    }
    messages
}

fn uncompressed() -> WriteOptions {
    WriteOptions::new().compression(None)
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn bag(&self, messages: &Messages) -> PathBuf {
        let path = self.path("bag.mcap");
        messages.write(&path, uncompressed());
        path
    }
}

fn opened(path: &Path) -> Box<dyn Dataset> {
    open(path, &DatasetOptions::default()).unwrap()
}

/// A known depth of a range bin, and perhaps the encoder's counts per turn.
fn with(encoder_counts: Option<u16>) -> DatasetOptions {
    DatasetOptions {
        range_resolution_m: Some(0.0438),
        encoder_counts,
        ..DatasetOptions::default()
    }
}

fn refused(path: &Path) -> String {
    let Err(error) = open(path, &DatasetOptions::default()) else {
        panic!("{} was opened", path.display());
    };
    let sentence = error.to_string();
    assert_eq!(sentence.lines().count(), 1, "{sentence}");
    sentence
}

fn assert_is(found: &OwnedScan, turn: usize) {
    let expected = scan(turn);
    assert_eq!(found.geometry, expected.geometry, "{turn}");
    assert_eq!(found.bytes, expected.bytes, "{turn}");
    assert_eq!(found.azimuth_rad, expected.azimuth_rad, "{turn}");
    assert_eq!(found.stamp_ns, expected.stamp_ns, "{turn}");
}

/// Reads all scans, in order and then from the last to the first.
fn assert_has_turns(dataset: &mut dyn Dataset, turns: usize) {
    assert_eq!(dataset.len(), turns);
    for turn in (0..turns).chain((0..turns).rev()) {
        assert_is(&dataset.scan(turn).unwrap(), turn);
    }
}

#[test]
fn scans_of_both_forms_come_back_in_any_order() {
    for messages in [b_scans(5), azimuths(5, |_, _, message| Some(message))] {
        for options in [
            uncompressed(),
            WriteOptions::new().compression(Some(Compression::Zstd)),
            WriteOptions::new().compression(Some(Compression::Lz4)),
            // Chunks that divide turns.
            uncompressed().chunk_size(Some(4000)),
            // The preset `fastwrite` of rosbag2.
            uncompressed().use_chunks(false),
            uncompressed()
                .use_chunks(false)
                .emit_summary_records(false)
                .emit_summary_offsets(false),
        ] {
            let folder = Folder::new();
            let path = folder.path("bag.mcap");
            messages.write(&path, options);
            assert!(is_bag(&path));
            let mut dataset = opened(&path);
            assert_eq!(dataset.format(), Format::Ros2Bag);
            assert_eq!(dataset.period_ns(), TURN_NS);
            assert_eq!(dataset.nominal_stamp_ns(2), Some(scan(2).geometry.stamp_ns));
            assert_has_turns(dataset.as_mut(), 5);
        }
    }
}

#[test]
fn a_written_bag_is_read_and_never_overwritten() {
    let folder = Folder::new();
    for name in ["bag", "bag.mcap"] {
        let path = folder.path(name);
        let mut bag = BagWriter::create(&path).unwrap();
        let configurations = bag.topic(CONFIGURATION, Kept::ForLater).unwrap();
        let scans = bag.topic(B_SCANS, Kept::ForNobody).unwrap();
        let messages = ScanMessages::new(radar(), "radar");
        let configuration = messages.configuration(START_NS);
        bag.write(&configurations, START_NS, &configuration)
            .unwrap();
        for turn in 0..3 {
            let log_ns = START_NS + TURN_NS * turn as i64;
            let message = messages.b_scan(scan(turn).view());
            bag.write(&scans, log_ns, &message).unwrap();
        }
        assert!(!path.exists());
        bag.finish().unwrap();
        assert!(is_bag(&path));
        assert_has_turns(opened(&path).as_mut(), 3);
        let refused = BagWriter::create(&path).err().unwrap().to_string();
        assert!(refused.contains("it exists"), "{refused}");
    }
    let dropped = folder.path("dropped");
    let writing = BagWriter::create(&dropped).unwrap();
    let refused = BagWriter::create(&dropped).err().unwrap().to_string();
    assert!(refused.contains("another command is writing"), "{refused}");
    drop(writing);
    assert_eq!(fs::read_dir(folder.0.path()).unwrap().count(), 2);
}

#[test]
fn azimuths_of_the_older_form_are_read_under_both_names() {
    let newer = azimuths(3, |_, _, message| Some(message));
    for name in [
        "messages/msg/RadarFftDataMessage",
        "nav_messages/msg/RadarFftDataMsg",
    ] {
        let mut older = Messages::default();
        for (topic, type_name, text, log_ns, data) in &newer.0 {
            if topic != AZIMUTH_DATA {
                older.add_bytes(topic, (type_name, text), *log_ns, data.clone());
                continue;
            }
            let message: RadarFftDataMsg = decode(data).unwrap();
            let older_message = RadarFftDataMessage {
                header: message.header,
                angle: vec![0, 0],
                azimuth: message.azimuth.to_be_bytes().to_vec(),
                sweep_counter: message.sweep_counter.to_be_bytes().to_vec(),
                ntp_seconds: message.ntp_seconds.to_be_bytes().to_vec(),
                ntp_split_seconds: message.ntp_split_seconds.to_be_bytes().to_vec(),
                data_length: message.data_length.to_be_bytes().to_vec(),
                data: message.data,
            };
            let text = RadarFftDataMessage::DEFINITION.text();
            let bytes = encode(&older_message).unwrap();
            older.add_bytes(topic, (name, &text), *log_ns, bytes);
        }
        let folder = Folder::new();
        assert_has_turns(opened(&folder.bag(&older)).as_mut(), 3);
    }
}

/// The driver's clock of a radar that has never received the time.
#[test]
fn a_radar_without_a_clock_has_the_times_of_the_driver() {
    let messages = azimuths(6, |_, _, message| {
        Some(RadarFftDataMsg {
            ntp_seconds: 0,
            ntp_split_seconds: 0,
            ..message
        })
    });
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    assert_has_turns(dataset.as_mut(), 6);
    let notes = dataset.notes().join(" ");
    assert!(notes.contains("time does not advance"), "{notes}");
}

#[test]
fn bags_that_cannot_be_used_say_why_in_one_sentence() {
    let folder = Folder::new();
    let mut odometry = Messages::default();
    odometry.add("/odom", START_NS, &Odometry::default());
    assert!(refused(&folder.bag(&odometry)).contains("has no scans of a radar"));

    let mut both = b_scans(3);
    both.0.extend(azimuths(3, |_, _, message| Some(message)).0);
    let path = folder.bag(&both);
    assert!(refused(&path).contains("--set dataset.topic=/radar_data"));
    let chosen = DatasetOptions {
        topic: Some(B_SCANS.try_into().unwrap()),
        ..DatasetOptions::default()
    };
    assert_eq!(open(&path, &chosen).unwrap().len(), 3);

    let few = azimuths(1, |_, row, message| (row < 10).then_some(message));
    assert!(refused(&folder.bag(&few)).contains("no complete turn"));
    assert!(refused(&folder.bag(&Messages::default())).contains("has no topics"));

    let mut compressed = b_scans(3);
    for (.., data) in &mut compressed.0 {
        data.splice(..4, [0x28, 0xb5, 0x2f, 0xfd]);
    }
    assert!(refused(&folder.bag(&compressed)).contains("compression_mode: none"));

    let mut sixteen = b_scans(3);
    for (.., data) in &mut sixteen.0[1..] {
        let mut message: RadarBScanMsg = decode(data).unwrap();
        message.b_scan_img.encoding = "mono16".to_owned();
        *data = encode(&message).unwrap();
    }
    let sentence = refused(&folder.bag(&sixteen));
    for words in ["cannot be decoded", "`mono16`", "`mono8`"] {
        assert!(sentence.contains(words), "{sentence}");
    }

    let path = folder.path("empty.mcap");
    fs::write(&path, []).unwrap();
    assert!(refused(&path).contains("signature of MCAP"));
    let gone = open(&folder.path("gone.mcap"), &DatasetOptions::default());
    assert!(matches!(gone, Err(OpenError::Io { .. })));
}

#[test]
fn without_a_configuration_the_depth_of_a_bin_must_be_given() {
    for messages in [b_scans(4), azimuths(4, |_, _, message| Some(message))] {
        let without = Messages(messages.0.into_iter().skip(1).collect());
        let folder = Folder::new();
        let path = folder.bag(&without);
        let sentence = refused(&path);
        assert!(
            sentence.contains("dataset.range_resolution_m"),
            "{sentence}"
        );
        let mut dataset = open(&path, &with(None)).unwrap();
        assert_has_turns(dataset.as_mut(), 4);
        let notes = dataset.notes().join(" ");
        assert!(notes.contains("does not describe itself"), "{notes}");
    }
}
