//! `gyre simulate`: a recording that nobody had to drive for.

use std::{io::IsTerminal, path::Path, process::ExitCode};

use gyre_simulator::{SimulationConfig, write_dataset};
use indicatif::ProgressBar;

use crate::{Failure, cli::SimulateArguments, configuration::Configuration, print};

/// Writes a simulated recording.
pub fn simulate(arguments: &SimulateArguments) -> Result<ExitCode, Failure> {
    let read = |path: &std::path::PathBuf| Configuration::read(path, &[]);
    let configuration = arguments.configuration.as_ref().map(read).transpose()?;
    let mut simulation = configuration.and_then(|configuration| configuration.simulation).unwrap_or_default();
    simulation.scans = arguments.scans.unwrap_or(simulation.scans);
    simulation.seed = arguments.seed.unwrap_or(simulation.seed);
    generate(&simulation, &arguments.out)?;
    print::line(format_args!("wrote {} scans to {}", simulation.scans, arguments.out.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Generates a recording, with a progress bar on a terminal.
pub fn generate(simulation: &SimulationConfig, out: &Path) -> Result<(), Failure> {
    let bar =
        if std::io::stderr().is_terminal() { ProgressBar::new(simulation.scans as u64) } else { ProgressBar::hidden() };
    bar.set_message("simulating");
    write_dataset(simulation, out, &mut |done, _| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    Ok(())
}
