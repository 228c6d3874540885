//! Bags of ROS 2: the file, and the messages in it.

use std::{fs, path::Path};

use bolero::{TypeGenerator, check};
use gyre_datasets::DatasetOptions;
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, edit_bytes},
};
use gyre_ros2_messages::radar::ScanMessages;
use mcap::WriteOptions;

use self::{
    messages::Messages,
    turn::{AZIMUTHS, START_NS, radar, scan},
};
use crate::recordings::folder;

#[path = "../../shared/formats/recording/tests/bags/messages.rs"]
mod messages;
#[path = "../../shared/formats/ros2-messages/tests/turn.rs"]
mod turn;

const TURNS: usize = 3;

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
fn messages(form: Form) -> Messages {
    let described = ScanMessages::new(radar(), "radar").configuration(START_NS);
    let mut sent = radar();
    sent.encoder_size = form.encoder_size.unwrap_or(sent.encoder_size);
    let (mut writer, mut messages) = (ScanMessages::new(sent, "radar"), Messages::default());
    messages.add("/configuration", START_NS, &described);
    for turn in 0..TURNS {
        let scan = scan(turn);
        if form.by_azimuth {
            for azimuth in writer.azimuths(scan.view()) {
                messages.add("/fft_data", azimuth.header.stamp.ns(), &azimuth);
            }
            continue;
        }
        let mut turn = writer.b_scan(scan.view());
        if form.has_microseconds {
            turn.timestamps.iter_mut().for_each(|ns| *ns /= 1_000);
        }
        messages.add("/b_scan_msg", scan.stamp_ns[AZIMUTHS - 1], &turn);
    }
    messages
}

/// Writes a bag without compression and checksums, so that edits of the file reach its messages.
fn write(path: &Path, messages: &Messages, chunks: bool) {
    let options = WriteOptions::new()
        .compression(None)
        .use_chunks(chunks)
        .chunk_size(Some(4000))
        .calculate_chunk_crcs(false);
    messages.write(path, options);
}

/// Opens a bag and reads all its scans, from the last to the first. An accepted bag must be
/// consistent.
fn use_bag(path: &Path) -> Result<(), Failure> {
    let mut dataset = gyre_recording::bags::open(path, &DatasetOptions::default())?;
    let mut refused = None;
    for index in (0..dataset.len()).rev() {
        match dataset.scan(index) {
            Ok(scan) => {
                assert!(scan.azimuth_rad.iter().all(|azimuth| azimuth.is_finite()));
                let stamp_ns = Some(scan.geometry.stamp_ns);
                assert_eq!(stamp_ns, dataset.nominal_stamp_ns(index));
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

fn edit_messages(Messages(messages): &mut Messages, edit: &BagEdit) {
    let count = messages.len();
    if count == 0 {
        return;
    }
    match edit {
        BagEdit::Message(index, edits) => {
            edit_bytes(&mut messages[usize::from(*index) % count].4, edits);
        }
        BagEdit::Lost(index) => {
            messages.remove(usize::from(*index) % count);
        }
        BagEdit::TimeFrom(index, by) => {
            let later = messages[usize::from(*index) % count..].iter_mut();
            later.for_each(|(.., log_ns, _)| *log_ns = log_ns.wrapping_add(*by));
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
