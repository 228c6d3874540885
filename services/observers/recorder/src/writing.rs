//! The thread that compresses and writes.

use std::time::Duration;

use gyre_recording::{RecordingError, SplitWriter};

use crate::queue::{Entry, Receiver, Taken};

const POLL_PERIOD: Duration = Duration::from_millis(100);

/// Writes messages until the queue ends.
pub(crate) fn write(mut recording: SplitWriter, queue: &Receiver) -> Result<(), RecordingError> {
    loop {
        match queue.take(POLL_PERIOD) {
            Taken::Entry(Entry::Message(message)) => recording.add(&message)?,
            Taken::Entry(Entry::Missed(topic, missed)) => recording.file.missed(topic, missed),
            Taken::Entry(Entry::Log(line)) => recording.file.add_log(line)?,
            Taken::Entry(Entry::Health(json, now_ns)) => {
                recording.file.add_health(&json, now_ns)?
            }
            Taken::Idle => recording.file.flush_if_due()?,
            Taken::Ended => return recording.file.finish(),
        }
    }
}
