//! Frees the places of killed observers during the run.

use std::{
    fs,
    time::{Duration, Instant},
};

use gyre_stage::Manifest;

use crate::{clean, run::Run};

const PERIOD: Duration = Duration::from_secs(1);
/// The same after a cleanup that failed or did not end. No stage needs it: every restart of a stage
/// includes a cleanup.
const PERIOD_AFTER_FAILURE: Duration = Duration::from_secs(30);

/// Looks for killed observers beside the run's own processes; returns when to look again. At a low
/// rate, since nothing informs the supervisor of their death.
pub(crate) fn sweep(run: &Run<'_>, processes: usize) -> Instant {
    let has_observers = nodes(run.manifest()) > processes;
    let failed =
        has_observers && clean::remove_dead_observers(run.manifest(), &run.transport).is_err();
    let period = match failed {
        true => PERIOD_AFTER_FAILURE,
        false => PERIOD,
    };
    Instant::now() + period
}

fn nodes(manifest: &Manifest) -> usize {
    let entries = fs::read_dir(manifest.root.join("nodes")).into_iter();
    let is_directory = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_dir());
    entries.flatten().flatten().filter(is_directory).count()
}
