//! The check of a whole journal before a run is resumed.

use std::{collections::VecDeque, path::Path};

use gyre_contract::{PoseHeader, flag};
use gyre_storage::{Busy, File, GroupSync};

use crate::{JournalError, Records, record::RECORDS};

/// Number of the last poses that a check returns: more than a power failure can take.
const LAST: usize = 8 * GroupSync::LIMIT as usize;

#[derive(Clone, Debug, Default)]
pub struct Content {
    pub poses: u64,
    /// True if the end of the stream follows them.
    pub ended: bool,
    /// Records at the end that are not whole, or not known to be in order: to be cut off by
    /// [`cut`].
    pub torn: u64,
    /// The last poses, oldest first; not all of them in a long journal.
    pub last: VecDeque<PoseHeader>,
}

/// Reads a whole journal, in bounded memory, and finds out what of it is valid.
///
/// A record that is not valid is one of two things. If no later record proves that it was on the
/// disk, and there are no more of them than can have been in danger, it results from a death or a
/// power failure, and it is cut off with all that follows: those poses are computed again. Else the
/// file was damaged after it had been written.
pub fn check(path: &Path) -> Result<Content, JournalError> {
    let Some(mut places) = Records::open(path)? else {
        return Ok(Content::default());
    };
    let (mut valid, mut ended) = (0, false);
    let mut last = VecDeque::with_capacity(LAST);
    let mut first_invalid = (!places.has_header).then_some(0);
    // The number of records that the later ones know to have been on the disk.
    let mut known_safe = 0;
    while let Some(place) = places.read() {
        let index = places.next - 1;
        // However long the file is, the answer is known here.
        if let Some(first) = first_invalid.filter(|first| index > first + GroupSync::LIMIT) {
            return Err(JournalError::damaged(path, first));
        }
        match (place?, first_invalid) {
            // Nothing follows the end of the stream.
            (Some(_), None) if ended => first_invalid = Some(index),
            (Some(record), None) => {
                valid += 1;
                ended = record.pose.item.is(flag::END);
                if last.len() == LAST {
                    last.pop_front();
                }
                last.extend((!ended).then_some(record.pose));
            }
            (Some(record), Some(_)) => {
                known_safe = known_safe.max(index.saturating_sub(record.in_danger.into()));
            }
            (None, None) => first_invalid = Some(index),
            (None, Some(_)) => {}
        }
    }
    match first_invalid {
        Some(first) if known_safe > first => Err(JournalError::damaged(path, first)),
        _ => Ok(Content {
            poses: valid - u64::from(ended),
            ended,
            torn: places.next - valid,
            last,
        }),
    }
}

/// Cuts a journal after `records` records. The cut survives a power failure. Waits up to a second
/// for a stage of a killed run that still writes it: that dies a moment after its supervisor.
pub fn cut(path: &Path, records: u64) -> Result<(), JournalError> {
    let file = File::open_or_create(path)?;
    if !file.lock()? {
        let path = path.to_owned();
        return Err(Busy { path }.into());
    }
    file.set_length(match records {
        0 => 0,
        _ => RECORDS.offset(records),
    })?;
    Ok(file.sync()?)
}
