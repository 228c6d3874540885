//! The log of a run, `log.jsonl`: all of its processes append one line for each event.

use std::sync::Mutex;

use tracing::span::EnteredSpan;
use tracing_subscriber::{filter::Targets, prelude::*};

use crate::{Manifest, RunError, manifest};

/// The filter of the log unless `GYRE_LOG` has another. The network layers of a link and of DDS
/// report each attempt to connect, each peer.
const FILTER: &str = "info,zenoh=error,rustdds=error,ros2_client=error";

fn log_filter() -> Result<Targets, RunError> {
    let filter = std::env::var("GYRE_LOG").unwrap_or_else(|_| FILTER.into());
    filter.parse().map_err(|error| {
        RunError::Input(format!(
            "GYRE_LOG is `{filter}` ({error}): say `debug`, or `info,zenoh=debug`"
        ))
    })
}

/// Starts logging to `log.jsonl`, where all processes append one line per event. While the returned
/// span lives, each line carries the name of the stage.
pub fn start_log(manifest: &Manifest, name: &str) -> Result<EnteredSpan, RunError> {
    let path = manifest.events();
    let file = manifest::options()
        .append(true)
        .open(&path)
        .map_err(RunError::file(&path))?;
    let lines = tracing_subscriber::fmt::layer()
        .json()
        // They would be printed to standard error, and panic if that cannot be written either.
        .log_internal_errors(false)
        .with_writer(Mutex::new(file))
        .with_filter(log_filter()?);
    // A second call in one process (tests) keeps the first log.
    let _ = tracing_subscriber::registry().with(lines).try_init();
    Ok(tracing::error_span!("process", stage = name).entered())
}
