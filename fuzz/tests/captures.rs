//! Captures: files with the messages of a radar, by TCP or as datagrams.

use std::{fs, path::Path};

use bolero::{TypeGenerator, check};
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, Number, edit_bytes},
};
use gyre_tools::radar_server::capture::{Capture, MAGIC, MAX_RECORD_BYTES};

use crate::{
    recordings::folder,
    streams::{datagrams, stream},
};

const PERIOD_NS: u64 = 2_000_000;

/// An edit of a capture.
#[derive(Clone, Debug, TypeGenerator)]
enum CaptureEdit {
    /// The time of a record.
    Time(u8, Number),
    /// The number of bytes in the head of a record.
    Count(u8, Number),
    /// The bytes of a record.
    Record(u8, Vec<ByteEdit>),
    /// A record that is not there.
    Lost(u8),
}

/// A record: its time, the number of bytes in its head, and its bytes.
struct Record(u64, u32, Vec<u8>);

fn edit_records(records: &mut Vec<Record>, edits: &[CaptureEdit]) {
    for edit in edits {
        let count = records.len().max(1);
        let mut record = |index: &u8, change: &dyn Fn(&mut Record)| {
            records
                .get_mut(usize::from(*index) % count)
                .map(change)
                .unwrap_or_default();
        };
        match edit {
            CaptureEdit::Time(index, time) => record(index, &|it| it.0 = time.bits()),
            CaptureEdit::Count(index, bytes) => record(index, &|it| it.1 = bytes.bits() as u32),
            CaptureEdit::Record(index, edits) => record(index, &|it| {
                edit_bytes(&mut it.2, edits);
                it.1 = it.2.len() as u32;
            }),
            CaptureEdit::Lost(index) if !records.is_empty() => {
                records.remove(usize::from(*index) % count);
            }
            CaptureEdit::Lost(_) => {}
        }
    }
}

/// Returns the bytes of a capture by TCP, or of datagrams.
fn capture(is_udp: bool, edits: &[CaptureEdit]) -> Vec<u8> {
    let pieces = match is_udp {
        true => datagrams(),
        // As they are read: not at the ends of messages.
        false => stream(&[]).chunks(701).map(<[u8]>::to_vec).collect(),
    };
    let times = (0..).map(|k| k * PERIOD_NS);
    let records = times.zip(pieces);
    let records = records.map(|(time_ns, bytes)| Record(time_ns, bytes.len() as u32, bytes));
    let mut records: Vec<Record> = records.collect();
    edit_records(&mut records, edits);
    let mut file = [&MAGIC[..], &[u8::from(is_udp)]].concat();
    for Record(time_ns, count, bytes) in records {
        file.extend(time_ns.to_le_bytes());
        file.extend(count.to_le_bytes());
        file.extend(bytes);
    }
    file
}

/// Reads all records, and the radar's description, as it is played; returns their number.
fn use_capture(path: &Path) -> Result<usize, Failure> {
    let open = || -> Result<Capture, Failure> {
        Ok(Capture::open(path)?.ok_or("the file is no capture")?)
    };
    let (mut capture, mut bytes, mut records) = (open()?, vec![0; MAX_RECORD_BYTES], 0);
    while let Some((_, count)) = capture.next(&mut bytes)? {
        assert!(count <= MAX_RECORD_BYTES);
        records += 1;
    }
    open()?.configuration()?.check()?;
    Ok(records)
}

#[test]
fn captures() {
    let target = Target::new(32);
    check!()
        .with_type::<(bool, Vec<CaptureEdit>, Vec<ByteEdit>)>()
        .for_each(|(is_udp, records, bytes)| {
            let folder = folder();
            let path = folder.path().join("radar.capture");
            let mut file = capture(*is_udp, records);
            edit_bytes(&mut file, bytes);
            fs::write(&path, file).unwrap();
            target.run(|| use_capture(&path).map(|_| ()));
        });
}

#[test]
fn a_capture_without_edits_is_accepted() {
    let folder = folder();
    let path = folder.path().join("radar.capture");
    for (is_udp, pieces) in [
        (true, datagrams().len()),
        (false, stream(&[]).len().div_ceil(701)),
    ] {
        fs::write(&path, capture(is_udp, &[])).unwrap();
        assert_eq!(use_capture(&path).unwrap(), pieces);
    }
}
