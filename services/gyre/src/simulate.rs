//! `gyre simulate`: writes a simulated recording.

use std::{
    io::IsTerminal, num::NonZeroUsize, path::Path, process::ExitCode,
    thread::available_parallelism, time::Instant,
};

use gyre_configuration::{Configuration, strict::path_value};
use gyre_results::Content;
use gyre_simulator::{SimulationConfig, SimulatorError, Summary, remove_dataset, write_dataset_on};
use gyre_terminal::{Failure, print};
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::SimulateArguments;

/// Writes a simulated recording, or completes one.
pub fn simulate(arguments: &SimulateArguments) -> Result<ExitCode, Failure> {
    Content::SIMULATION.require_place(&arguments.out)?;
    let overrides = overrides(arguments)?;
    let configuration = match &arguments.configuration {
        Some(named) => gyre_terminal::inputs::configuration(named, &overrides)?,
        None => Configuration::of_overrides(&overrides)?,
    };
    let started = Instant::now();
    let threads = arguments
        .threads
        .or(available_parallelism().ok())
        .unwrap_or(NonZeroUsize::MIN);
    let summary = write(
        threads,
        &configuration.simulation.unwrap_or_default(),
        &arguments.out,
    )?;
    let (written, wall_s) = (
        summary.scans - summary.kept,
        started.elapsed().as_secs_f64(),
    );
    let kept = if summary.kept > 0 {
        format!(", {} were there already", summary.kept)
    } else {
        String::new()
    };
    print::line(format_args!(
        "wrote {written} scans to {} in {wall_s:.1} s ({:.1} scans/s{kept}): {} scans, {:.0} m, {:.0} s",
        arguments.out.display(),
        written as f64 / wall_s,
        summary.scans,
        summary.path_m,
        summary.duration_s,
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the options of the command line as overrides `section.key=value`.
fn overrides(arguments: &SimulateArguments) -> Result<Vec<String>, Failure> {
    let scans = arguments
        .scans
        .map(|scans| format!("simulation.scans={scans}"));
    let seed = arguments.seed.map(|seed| format!("simulation.seed={seed}"));
    let format = arguments
        .format
        .map(|format| format!("simulation.output.format={format}"));
    let file = arguments
        .trajectory
        .as_deref()
        .map(path_value)
        .transpose()?;
    let file = file.map(|file| format!("simulation.drive.file={file}"));
    let options = [scans, seed, format, file].into_iter().flatten();
    Ok(arguments.set.iter().cloned().chain(options).collect())
}

/// Writes the recording of a run to `out`, or completes it. If `replace`, it replaces the recording
/// of an earlier run.
pub fn store(simulation: &SimulationConfig, out: &Path, replace: bool) -> Result<(), Failure> {
    let threads = available_parallelism().unwrap_or(NonZeroUsize::MIN);
    match write(threads, simulation, out) {
        Err(SimulatorError::OtherFiles(_)) if replace => {
            remove_dataset(out).map_err(|error| {
                format!("cannot replace the recording of an earlier run: {error}, which is another --out")
            })?;
            write(threads, simulation, out)?;
        }
        result => drop(result?),
    }
    Ok(())
}

/// Writes a recording, with a progress bar on a terminal.
fn write(
    threads: NonZeroUsize,
    simulation: &SimulationConfig,
    out: &Path,
) -> Result<Summary, SimulatorError> {
    let bar = if std::io::stderr().is_terminal() {
        ProgressBar::new(0)
    } else {
        ProgressBar::hidden()
    };
    if let Ok(style) = ProgressStyle::with_template(
        "simulating {wide_bar} {pos}/{len} scans, {per_sec}, {eta} left",
    ) {
        bar.set_style(style);
    }
    let summary = write_dataset_on(threads, simulation, out, &mut |done, total| {
        if bar.length() != Some(total as u64) {
            bar.set_length(total as u64);
            // Existing scans do not count for the rate.
            bar.set_position(done as u64);
            bar.reset_eta();
        }
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    summary
}
