//! Bags of ROS 2: the file, and the messages in it.

use std::{collections::BTreeMap, fs, path::Path};

use bolero::{TypeGenerator, check};
use gyre_colossus::Configuration;
use gyre_datasets::DatasetOptions;
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, edit_bytes},
};
use gyre_geometry::{OwnedScan, ScanLimits, Sense, SweepGeometry, scan::flag};
use gyre_ros2_messages::{Ros2Message, encode, radar::ScanMessages};
use mcap::{WriteOptions, Writer, records::MessageHeader};

use crate::recordings::folder;

const AZIMUTHS: usize = 16;
const BINS: usize = 24;
const TURNS: usize = 3;
const START_NS: i64 = 1_547_131_046_000_000_000;

/// A message of a bag.
struct Message {
    topic: &'static str,
    type_name: String,
    text: String,
    log_ns: i64,
    data: Vec<u8>,
}

impl Message {
    fn of<T: Ros2Message>(topic: &'static str, log_ns: i64, message: &T) -> Self {
        Self {
            topic,
            type_name: T::DEFINITION.type_name(),
            text: T::DEFINITION.text(),
            log_ns,
            data: encode(message).unwrap(),
        }
    }
}

fn radar() -> Configuration {
    Configuration {
        azimuth_samples: AZIMUTHS as u16,
        range_in_bins: BINS as u16,
        encoder_size: 5600,
        rotation_mhz: 4000,
        range_resolution_m: Some(0.0438),
        ..Configuration::default()
    }
}

fn scan(turn: usize) -> OwnedScan {
    let mut scan = OwnedScan::with_limits(ScanLimits {
        bytes: AZIMUTHS * BINS,
        azimuths: AZIMUTHS,
    });
    for row in 0..AZIMUTHS {
        let encoder = (350 * row + 13) as f64;
        scan.azimuth_rad[row] = (encoder * std::f64::consts::TAU / 5600.0) as f32;
        scan.stamp_ns[row] = START_NS + (250_000_000 * turn + 15_625_000 * row) as i64;
        scan.flags[row] = flag::MEASURED;
    }
    scan.bytes = (0..AZIMUTHS * BINS).map(|k| k as u8).collect();
    scan.geometry = SweepGeometry {
        azimuths: AZIMUTHS,
        bins: BINS,
        stride: BINS,
        first_byte: 0,
        range_resolution_m: 0.0438,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        sense: Sense::Clockwise,
        stamp_ns: scan.stamp_ns[AZIMUTHS / 2],
    };
    scan
}

/// The form of a bag.
#[derive(Clone, Copy, Debug, Default, TypeGenerator)]
struct Form {
    /// Azimuth by azimuth, otherwise turn by turn.
    by_azimuth: bool,
    /// The encoder's counts per turn, if they differ from the radar's own statement.
    encoder_size: Option<u16>,
    /// Times of rows in microseconds.
    has_microseconds: bool,
}

/// The messages of a bag.
fn messages(form: Form) -> Vec<Message> {
    let described = ScanMessages::new(radar(), "radar").configuration(START_NS);
    let mut sent = radar();
    sent.encoder_size = form.encoder_size.unwrap_or(sent.encoder_size);
    let mut writer = ScanMessages::new(sent, "radar");
    let mut messages = vec![Message::of("/configuration", START_NS, &described)];
    for turn in 0..TURNS {
        let scan = scan(turn);
        let end_ns = scan.stamp_ns[AZIMUTHS - 1];
        if form.by_azimuth {
            for azimuth in writer.azimuths(scan.view()) {
                let stamp_ns = azimuth.header.stamp.ns();
                messages.push(Message::of("/fft_data", stamp_ns, &azimuth));
            }
            continue;
        }
        let mut turn = writer.b_scan(scan.view());
        if form.has_microseconds {
            turn.timestamps.iter_mut().for_each(|ns| *ns /= 1_000);
        }
        messages.push(Message::of("/b_scan_msg", end_ns, &turn));
    }
    messages
}

/// Writes a bag without compression and checksums, so that edits of the file reach its messages.
fn write(path: &Path, messages: &[Message], chunks: bool) {
    let options = WriteOptions::new()
        .profile("ros2")
        .compression(None)
        .use_chunks(chunks)
        .chunk_size(Some(2000))
        .calculate_chunk_crcs(false);
    let mut mcap: Writer<fs::File> = options.create(fs::File::create(path).unwrap()).unwrap();
    for (sequence, message) in messages.iter().enumerate() {
        let (name, text) = (&message.type_name, message.text.as_bytes());
        let schema = mcap.add_schema(name, "ros2msg", text).unwrap();
        let channel = mcap.add_channel(schema, message.topic, "cdr", &BTreeMap::new());
        let header = MessageHeader {
            channel_id: channel.unwrap(),
            sequence: sequence as u32,
            log_time: message.log_ns as u64,
            publish_time: message.log_ns as u64,
        };
        mcap.write_to_known_channel(&header, &message.data).unwrap();
    }
    mcap.finish().unwrap();
}

/// Opens a bag and reads all its scans, from the last to the first. An accepted bag must be
/// consistent.
fn use_bag(path: &Path) -> Result<(), Failure> {
    let mut dataset = gyre_recording::bags::open(path, &DatasetOptions::default())?;
    let mut refused = None;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    for index in (0..dataset.len()).rev() {
        match dataset.read(index, scan.slot()) {
            Ok(geometry) => {
                scan.geometry = geometry;
                assert!(scan.azimuth_rad.iter().all(|azimuth| azimuth.is_finite()));
                assert_eq!(Some(geometry.stamp_ns), dataset.nominal_stamp_ns(index));
            }
            Err(error) => refused = Some(error),
        }
        assert!(dataset.file(index).starts_with(path));
    }
    refused.map_or(Ok(()), |error| Err(error.into()))
}

#[derive(Clone, Debug, TypeGenerator)]
enum BagEdit {
    /// The bytes of the file.
    File(Vec<ByteEdit>),
    /// The bytes of a message.
    Message(u8, Vec<ByteEdit>),
    /// A message is missing.
    Lost(u8),
    /// The times of receipt from a message on, shifted.
    TimeFrom(u8, i64),
}

#[test]
fn bags() {
    // The largest scan that a radar may claim, twice.
    let target = Target::new(320);
    check!()
        .with_type::<(Form, bool, Vec<BagEdit>)>()
        .for_each(|(form, chunks, edits)| {
            let (folder, mut messages) = (folder(), messages(*form));
            let path = folder.path().join("bag.mcap");
            for edit in edits {
                edit_messages(&mut messages, edit);
            }
            write(&path, &messages, *chunks);
            let mut file = fs::read(&path).unwrap();
            for edit in edits {
                if let BagEdit::File(edits) = edit {
                    edit_bytes(&mut file, edits);
                }
            }
            fs::write(&path, file).unwrap();
            target.run(|| use_bag(&path));
        });
}

fn edit_messages(messages: &mut Vec<Message>, edit: &BagEdit) {
    let count = messages.len();
    if count == 0 {
        return;
    }
    match edit {
        BagEdit::Message(index, edits) => {
            edit_bytes(&mut messages[usize::from(*index) % count].data, edits);
        }
        BagEdit::Lost(index) => {
            messages.remove(usize::from(*index) % count);
        }
        BagEdit::TimeFrom(index, by) => {
            let later = messages[usize::from(*index) % count..].iter_mut();
            later.for_each(|message| message.log_ns = message.log_ns.wrapping_add(*by));
        }
        BagEdit::File(_) => {}
    }
}

#[test]
fn a_bag_without_edits_is_accepted() {
    for (by_azimuth, encoder_size) in [(false, None), (false, Some(2800)), (true, Some(16_000))] {
        let form = Form {
            by_azimuth,
            encoder_size,
            has_microseconds: !by_azimuth,
        };
        let folder = folder();
        let path = folder.path().join("bag.mcap");
        for chunks in [false, true] {
            write(&path, &messages(form), chunks);
            use_bag(&path).unwrap();
            let dataset = gyre_recording::bags::open(&path, &DatasetOptions::default()).unwrap();
            assert_eq!(dataset.len(), TURNS, "{form:?}");
        }
    }
}
