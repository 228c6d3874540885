//! The thread that compresses and writes.

use std::{sync::mpsc::RecvTimeoutError, time::Duration};

use gyre_recording::{RecordingError, SplitWriter};

use crate::recorder::queue::{Entry, Receiver};

const POLL_PERIOD: Duration = Duration::from_millis(100);

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
