//! The queue between the thread that receives and the one that writes. Its limit is one of bytes.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    time::Duration,
};

use gyre_recording::{Incoming, LogLine, RecordingError, SplitWriter};

/// The largest number of bytes that wait: twenty seconds of the largest radar's scans at four in a
/// second, should the disk stand still.
pub(crate) const LIMIT_BYTES: usize = 128 << 20;

const POLL_PERIOD: Duration = Duration::from_millis(100);

#[derive(Debug)]
pub(crate) enum Entry {
    Message(Incoming),
    /// Messages of a topic that were missed, without one after them.
    Missed(&'static str, u64),
    Log(LogLine),
    /// The run's health, JSON, and when it was reported, ns since 1970.
    Health(String, i64),
}

impl Entry {
    fn bytes(&self) -> usize {
        match self {
            Self::Message(message) => message.header.len() + message.payload.len(),
            Self::Missed(..) => 0,
            Self::Log(line) => line.message.len(),
            Self::Health(json, _) => json.len(),
        }
    }
}

pub(crate) struct Sender {
    entries: mpsc::Sender<Entry>,
    waiting: Arc<AtomicUsize>,
    limit: usize,
}

pub(crate) struct Receiver {
    entries: mpsc::Receiver<Entry>,
    waiting: Arc<AtomicUsize>,
}

pub(crate) fn queue(limit: usize) -> (Sender, Receiver) {
    let (sender, receiver) = mpsc::channel();
    let waiting = Arc::new(AtomicUsize::new(0));
    let sender = Sender {
        entries: sender,
        waiting: Arc::clone(&waiting),
        limit,
    };
    let receiver = Receiver {
        entries: receiver,
        waiting,
    };
    (sender, receiver)
}

impl Sender {
    /// Puts an entry into the queue; false if there is no room for it, or nobody takes it any more.
    pub fn put(&self, entry: Entry) -> bool {
        let bytes = entry.bytes();
        if bytes > 0 && self.waiting.load(Ordering::Relaxed) + bytes > self.limit {
            return false;
        }
        self.waiting.fetch_add(bytes, Ordering::Relaxed);
        self.entries.send(entry).is_ok()
    }
}

impl Receiver {
    pub fn take(&self, limit: Duration) -> Result<Entry, RecvTimeoutError> {
        let entry = self.entries.recv_timeout(limit)?;
        self.waiting.fetch_sub(entry.bytes(), Ordering::Relaxed);
        Ok(entry)
    }
}

/// Writes messages until the queue ends.
pub(crate) fn write(mut recording: SplitWriter, queue: &Receiver) -> Result<(), RecordingError> {
    loop {
        match queue.take(POLL_PERIOD) {
            Ok(Entry::Message(message)) => recording.add(&message)?,
            Ok(Entry::Missed(topic, missed)) => recording.file.missed(topic, missed),
            Ok(Entry::Log(line)) => recording.file.add_log(line)?,
            Ok(Entry::Health(json, now_ns)) => recording.file.add_health(&json, now_ns)?,
            Err(RecvTimeoutError::Timeout) => recording.file.flush_if_due()?,
            Err(RecvTimeoutError::Disconnected) => return recording.file.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(bytes: usize) -> Entry {
        Entry::Message(Incoming {
            topic: "scan",
            header: Vec::new(),
            payload: vec![0; bytes],
            received_ns: 0,
            missed: 0,
            skipped: None,
        })
    }

    #[test]
    fn a_queue_takes_entries_up_to_its_limit_and_again_when_they_are_taken() {
        let (sender, receiver) = queue(100);
        assert!(sender.put(message(60)));
        assert!(!sender.put(message(41)));
        assert!(sender.put(message(40)));
        assert!(sender.put(Entry::Missed("scan", 1)), "counts always fit");
        assert!(receiver.take(Duration::ZERO).is_ok());
        assert!(sender.put(message(60)));
        drop(sender);
        for _ in 0..3 {
            assert!(receiver.take(Duration::ZERO).is_ok());
        }
        let ended = receiver.take(Duration::ZERO).err();
        assert_eq!(ended, Some(RecvTimeoutError::Disconnected));
    }
}
