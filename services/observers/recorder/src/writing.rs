//! The thread that compresses and writes.

use std::{collections::BTreeMap, sync::mpsc::RecvTimeoutError, time::Duration};

use gyre_recording::{RecordingError, SplitWriter};

use crate::queue::{Entry, Receiver};

const POLL_PERIOD: Duration = Duration::from_millis(100);

/// Writes messages until the queue ends; returns the number of messages missed by topic.
pub(crate) fn write(
    mut recording: SplitWriter,
    queue: &Receiver,
) -> Result<BTreeMap<String, u64>, RecordingError> {
    loop {
        match queue.take(POLL_PERIOD) {
            Ok(Entry::Message(message)) => recording.add(&message)?,
            Ok(Entry::Missed(topic, missed)) => recording.missed(topic, missed),
            Ok(Entry::Log(line)) => recording.add_log(line)?,
            Ok(Entry::Health(json, now_ns)) => recording.add_health(&json, now_ns)?,
            Err(RecvTimeoutError::Timeout) => recording.flush_if_due()?,
            Err(RecvTimeoutError::Disconnected) => return recording.finish(),
        }
    }
}
