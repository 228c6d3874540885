//! Logs of every format, as written here after the public development kits, their faults, and the
//! real ones.

mod faults;
mod formats;
mod wheels;

use gyre_datasets::{LogError, SampleLog};
use tempfile::TempDir;

use crate::common::written;

/// 2025-10-14, ns.
const START_NS: i64 = 1_760_456_485_551_626_000;

/// Reads a text as a file of this name.
fn read(name: &str, text: &str) -> Result<SampleLog, LogError> {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, name, text);
    SampleLog::read_gyro(&path)
}
