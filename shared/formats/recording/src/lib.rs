//! Recordings of runs as MCAP files, for viewers and for exact replay; and [`bags`] of ROS 2, which
//! are MCAP files too.
//!
//! Each message of a run is in the file twice over, without its bulk being stored twice:
//!
//! | channel | encoding | content |
//! |---|---|---|
//! | `/scan`, `/masked` | protobuf, `foxglove.RawImage` | the powers of a scan (`mono8`, azimuth x range), the raster of a masked scan (`32FC1`) |
//! | `/motion`, `/pose`, `/tf`, `/log` and others | protobuf, Foxglove's schemas | what a viewer draws: [`view`] |
//! | `gyre/TOPIC` | `gyre`, schema `gyre_TOPIC_header_vN` | the header of the wire message, then what of its payload no image holds |
//!
//! The image of a message stands directly before it, in the same chunk and with the same sequence
//! number. [`image`] takes a payload apart and puts it together again.
//!
//! The log time of a message is the sensor's: the stamp of its scan. So a drive that was replayed
//! thirty times faster plays at its own pace. The publish time is measured by the machine that runs
//! the recorder, at reception.
//!
//! Behind each chunk a metadata record (`table`) lists its messages and all messages missed so far.
//! So a reader finds a message without decompressing earlier chunks, even in a file without a
//! summary because its writer was killed.

pub mod bags;
mod disk;
mod early_lines;
mod error;
pub mod file;
mod generations;
mod gnss;
mod head;
pub mod image;
mod ledger;
mod log_tail;
mod newest;
mod open;
mod parts;
mod position;
mod recording;
mod scans;
mod split;
mod table;
pub mod view;
mod writer;

pub use error::RecordingError;
pub use gnss::{copied_fixes, gnss_log, received_fixes};
pub use gyre_datasets::ReceivedFixes;
pub use head::Head;
pub use ledger::{Begun, Ledger};
pub use log_tail::LogTail;
pub use open::{is_recording, open, open_recording, open_resolved, reopen, stored_options};
pub use parts::{next_part, parts};
pub use position::{Position, Positions};
pub use recording::{Recording, Stored};
pub use split::{Split, SplitWriter};
pub use table::Entry;
pub use view::LogLine;
pub use writer::{Incoming, RecordingWriter};

fn exact_channel(topic: &str) -> String {
    format!("gyre/{topic}")
}

/// The encoding of the wire messages, and of their schemas.
const ENCODING: &str = "gyre";
