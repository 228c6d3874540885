//! Logs of GNSS receivers of every format, as written here after the public development kits, and
//! their faults.

mod faults;
mod formats;

use std::{fs, path::PathBuf};

use gyre_datasets::{GnssLog, LogError};
use tempfile::TempDir;

/// 2025-10-14, ns.
const START_NS: i64 = 1_760_456_485_551_626_000;

/// Reads a text as a file of this name.
fn read(name: &str, text: &str) -> Result<GnssLog, LogError> {
    let folder = TempDir::new().unwrap();
    let path = written(&folder, name, text);
    GnssLog::read(&path)
}

fn written(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, text).unwrap();
    path
}
