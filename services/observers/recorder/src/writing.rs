//! The thread that compresses and writes.

use std::{collections::BTreeMap, time::Duration};

use gyre_recording::{RecordingError, SplitWriter};

use crate::queue::{Entry, Receiver, Taken};

const POLL_PERIOD: Duration = Duration::from_millis(100);

/// Writes messages until the queue ends; returns the number of messages missed by topic.
pub(crate) fn write(
    mut recording: SplitWriter,
    queue: &Receiver,
) -> Result<BTreeMap<String, u64>, RecordingError> {
    loop {
        match queue.take(POLL_PERIOD) {
            Taken::Entry(Entry::Message(message)) => recording.add(&message)?,
            Taken::Entry(Entry::Missed(topic, missed)) => recording.missed(topic, missed),
            Taken::Entry(Entry::Log(line)) => recording.add_log(line)?,
            Taken::Entry(Entry::Health(json, now_ns)) => recording.add_health(&json, now_ns)?,
            Taken::Idle => recording.flush_if_due()?,
            Taken::Ended => return recording.finish(),
        }
    }
}
