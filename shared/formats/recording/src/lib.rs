//! Recordings of runs as MCAP files, for viewers and for exact replay; and [`bags`] of ROS 2, which
//! are MCAP files too.
//!
//! A message of a run is in the file twice over, without its bulk being stored twice: as what a
//! viewer draws, in Foxglove's schemas ([`view`]), and on the channel `gyre/TOPIC` (schema
//! `gyre_TOPIC_header_vN`) as the header of the wire message, then what of its payload no image
//! holds. The image stands directly before it, in the same chunk and with the same sequence number:
//! [`image`] takes a payload apart and puts it together again.
//!
//! The log time of a message is the stamp of its scan, so that a drive that was replayed faster
//! plays at its own pace; the publish time is the time of reception by the recorder.
//!
//! Behind each chunk a metadata record (`table`) lists its messages and all messages missed so far,
//! so that a reader finds a message even in a file whose writer was killed before its summary.

pub mod bags;
mod error;
pub mod file;
mod generations;
mod gnss;
mod head;
pub mod image;
mod log_tail;
mod open;
mod parts;
mod recording;
mod scans;
mod table;
pub mod view;
mod writer;

pub use error::RecordingError;
pub use gnss::{copied_fixes, gnss_log, received_fixes};
pub use gyre_datasets::ReceivedFixes;
pub use head::{Head, Position, Positions};
pub use log_tail::LogTail;
pub use open::{is_recording, open, open_recording, open_resolved, reopen, stored_options};
pub use parts::{Begun, Ledger, Split, SplitWriter, next_part, parts};
pub use recording::{Recording, Stored};
pub use table::Entry;
pub use view::LogLine;
pub use writer::{Incoming, RecordingWriter};

fn exact_channel(topic: &str) -> String {
    format!("gyre/{topic}")
}

/// The encoding of the wire messages, and of their schemas.
const ENCODING: &str = "gyre";
