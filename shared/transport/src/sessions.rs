//! The log of when a run began and when and why it ended, for whoever asks for a run that is over.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use tracing_subscriber::fmt::{
    format::Writer,
    time::{FormatTime, SystemTime},
};

use crate::{Manifest, RunError, manifest, run};

const SESSIONS: &str = "log/supervisor.txt";
pub const BEGUN: &str = "the run begins";

/// Logs that the run begins, or why it ends. Without a place for that the run is the same.
pub fn log_session(run: &Manifest, event: &str) {
    let mut line = String::new();
    // Writing to a string does not fail.
    let _ = SystemTime.format_time(&mut Writer::new(&mut line));
    line += &format!(" {event}\n");
    let file = manifest::options()
        .append(true)
        .open(run.out.join(SESSIONS));
    let _ = file.and_then(|mut file| file.write_all(line.as_bytes()));
}

/// Returns the error that no run writes to `out`, with when and why the last one ended.
pub fn not_running(out: PathBuf) -> RunError {
    let end = last_end(&out);
    RunError::NotRunning { out, end }
}

fn last_end(out: &Path) -> String {
    if let Ok(out) = out.canonicalize()
        && run::is_alive(&run::root_of(&out))
    {
        return " (one is about to begin, or writes its results)".to_owned();
    }
    let text = gyre_storage::read_text(&out.join(SESSIONS), gyre_storage::SETTINGS);
    match text.unwrap_or_default().lines().last() {
        None => String::new(),
        Some(last) => match last.strip_suffix(BEGUN) {
            Some(time) => format!(" (the last one began at {time}and was killed)"),
            None => format!(" ({last})"),
        },
    }
}
