use std::{fs, path::Path, sync::Mutex, thread};

use bytemuck::bytes_of;
use gyre_contract::PoseHeader;

use super::*;

fn head(part: usize) -> Head {
    Head {
        id: "a".to_owned(),
        part,
        topics: vec!["pose".to_owned()],
        ..Head::default()
    }
}

fn pose() -> Incoming {
    Incoming {
        topic: "pose",
        header: bytes_of(&PoseHeader::default()).to_vec(),
        payload: Vec::new(),
        received_ns: 0,
        missed: 0,
        skipped: None,
    }
}

fn bytes(path: &Path) -> u64 {
    fs::metadata(path).unwrap().len()
}

/// The length of the file whenever it was synchronised.
fn noting(safe: &Arc<Mutex<Vec<u64>>>) -> Synchronise {
    let safe = safe.clone();
    Arc::new(move |file| {
        file.sync_data()?;
        safe.lock().unwrap().push(file.metadata()?.len());
        Ok(())
    })
}

#[test]
fn what_is_older_than_a_second_is_synchronised_and_at_the_end_all() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.mcap", "a.2.mcap"].map(|name| folder.path().join(name));
    let synchronised = Arc::<Mutex<Vec<u64>>>::default();
    let safe = || synchronised.lock().unwrap().last().copied().unwrap_or(0);
    let mut writer = RecordingWriter::create_with(&first, &head(1), noting(&synchronised)).unwrap();
    let (began, mut written) = (Instant::now(), Vec::new());
    while began.elapsed() < 3 * SYNC_PERIOD {
        writer.add(&pose()).unwrap();
        let now = Instant::now();
        writer.flush_if_due().unwrap();
        let is_old = |(at, _): &&(Instant, u64)| now.duration_since(*at) >= SYNC_PERIOD;
        let old = written.iter().rev().find(is_old);
        assert!(old.is_none_or(|(_, bytes)| *bytes <= safe()), "{old:?}");
        written.push((Instant::now(), bytes(&first)));
        thread::sleep(Duration::from_millis(20));
    }
    let times = synchronised.lock().unwrap().len();
    assert!((1..=3).contains(&times), "{times}: once a second is enough");
    writer.end().unwrap();
    assert_eq!(safe(), bytes(&first), "also its end");
    writer.go_on(&second, &head(2)).unwrap();
    writer.add(&pose()).unwrap();
    writer.finish().unwrap();
    assert_eq!(safe(), bytes(&second), "the next part as well");
}

#[test]
fn a_failure_to_synchronise_is_one_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let fails: Synchronise = Arc::new(|_| Err(io::ErrorKind::StorageFull.into()));
    let writer = RecordingWriter::create_with(&path, &head(1), fails).unwrap();
    writer.finish().unwrap_err();
}

#[test]
fn the_newest_early_lines_are_kept_and_the_others_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = RecordingWriter::create(&path, &head(1)).unwrap();
    for number in 0..MAX_EARLY + 2 {
        let message = format!("line {number}.");
        let line = LogLine {
            message,
            ..LogLine::default()
        };
        writer.add_log(line).unwrap();
    }
    writer.add(&pose()).unwrap();
    writer.finish().unwrap();
    let bytes = fs::read(&path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap();
    let messages = messages.map(|message| message.unwrap());
    let logged = messages.filter(|message| message.channel.topic == "/log");
    let lines: Vec<String> = logged
        .map(|message| String::from_utf8_lossy(&message.data).into_owned())
        .collect();
    assert_eq!(lines.len(), MAX_EARLY + 1);
    for (line, words) in lines.iter().zip(["2 lines before", "line 2.", "line 3."]) {
        assert!(line.contains(words), "{line}");
    }
}
