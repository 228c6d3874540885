//! Recordings of runs: MCAP files whose bytes are edited.

use std::{fs, path::Path, slice};

use bolero::check;
use gyre_contract::{GivenAnew, Item};
use gyre_datasets::DatasetOptions;
use gyre_fuzz::{
    Failure, Target,
    edit::{ByteEdit, edit_bytes},
};
use gyre_recording::{Incoming, LogLine, Recording, RecordingWriter};

use crate::recordings::folder;

#[path = "../../shared/formats/recording/tests/written/mod.rs"]
mod written;

const SCANS: u64 = 3;

fn scan(seq: u64) -> Incoming {
    let item = Item {
        // The radar's source was started again twice before each.
        generation: 2 * seq as u32 + 1,
        numbered_from: seq,
        ..written::item(seq)
    };
    Incoming {
        missed: 1,
        skipped: (seq > 0).then_some(GivenAnew {
            generation: 2 * seq as u32,
            first: seq,
        }),
        ..written::scan(item)
    }
}

/// Returns the bytes of a recording with a chunk for each scan.
fn recording() -> Vec<u8> {
    let folder = folder();
    let path = folder.path().join("run.mcap");
    let mut writer = RecordingWriter::create(&path, &written::head("a", 1)).unwrap();
    for seq in 0..SCANS {
        writer.add(&scan(seq)).unwrap();
        writer.flush().unwrap();
    }
    writer.add_log(LogLine::default()).unwrap();
    writer.finish().unwrap();
    fs::read(&path).unwrap()
}

/// Reads all messages, and all scans as a dataset.
fn use_run(path: &Path) -> Result<(), Failure> {
    let mut recording = Recording::open(slice::from_ref(&path.to_owned()))?;
    let seqs: Vec<u64> = recording.entries("scan").map(|entry| entry.seq).collect();
    let messages = seqs.into_iter().map(|seq| recording.read("scan", seq));
    let refused = messages.filter_map(Result::err).last();

    let mut dataset = gyre_recording::open(path, &DatasetOptions::default())?;
    // A damaged number of a scan leaves a gap of any length.
    for index in dataset.scans().take(100) {
        if let Ok(scan) = dataset.scan(index) {
            scan.view().check().unwrap();
        }
    }
    refused.map_or(Ok(()), |error| Err(error.into()))
}

#[test]
fn runs() {
    let (target, folder, recording) = (Target::new(320), folder(), recording());
    let path = folder.path().join("run.mcap");
    fs::write(&path, &recording).unwrap();
    use_run(&path).unwrap();
    let dataset = gyre_recording::open(&path, &DatasetOptions::default()).unwrap();
    assert_eq!(dataset.scans().count(), SCANS as usize);
    check!().with_type::<Vec<ByteEdit>>().for_each(|edits| {
        let mut file = recording.clone();
        edit_bytes(&mut file, edits);
        fs::write(&path, file).unwrap();
        target.run(|| use_run(&path));
    });
}
