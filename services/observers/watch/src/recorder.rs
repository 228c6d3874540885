//! The recorder: an observer that writes the messages of a running run to an MCAP file.
//!
//! One thread takes messages from the observers' queues and copies them, and a second thread
//! compresses and writes. Between them is a queue with a limit in bytes. So a slow disk costs
//! memory first, and then messages, which are counted. Nothing that the recorder does reaches the
//! run: see [`gyre_client::observer`].

mod begin;
mod health;
mod options;
mod queue;
mod recorder;
mod tap;
mod writing;

pub use begin::{require_new, require_own};
pub use gyre_recording::{Ledger, Split};
pub use options::Options;
pub use recorder::{Recorded, record};
