//! `gyre simulate`: writes a simulated recording.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use clap::Args;
use gyre_configuration::{
    strict::path_value,
    terminal::{Failure, inputs::configuration, print},
};
use gyre_results::Content;
use gyre_simulator::{
    OutputFormat, SimulationConfig, SimulatorError, Summary, remove_dataset, write_dataset,
};
use gyre_tools::bar::Bar;

#[derive(Debug, Args)]
pub struct SimulateArguments {
    /// The configuration, a TOML file or a name that `gyre config` lists: its section
    /// `[simulation]` is used. Default: the defaults of that section.
    pub configuration: Option<PathBuf>,
    /// The folder of the recording. The files of an earlier call with the same configuration are
    /// kept and completed.
    #[arg(long)]
    pub out: PathBuf,
    /// Number of scans (simulation.scans).
    #[arg(long)]
    pub scans: Option<usize>,
    /// Drive along this file: TUM, KITTI, Oxford radar_odometry.csv, Boreas radar_poses.csv.
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Seed (simulation.seed).
    #[arg(long)]
    pub seed: Option<u64>,
    /// The format of the files: oxford, boreas or radiate (simulation.output.format).
    #[arg(long)]
    pub format: Option<OutputFormat>,
    /// Override a key, as in simulation.drive.speed_mps=5; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

pub fn simulate(arguments: &SimulateArguments) -> Result<(), Failure> {
    Content::SIMULATION.require_place(&arguments.out)?;
    let overrides = overrides(arguments)?;
    let configuration = configuration(arguments.configuration.as_deref(), &overrides)?;
    let started = Instant::now();
    let simulation = configuration.simulation.unwrap_or_default();
    let summary = write(&simulation, &arguments.out)?;
    let (written, wall_s) = (
        summary.scans - summary.kept,
        started.elapsed().as_secs_f64(),
    );
    let kept = match summary.kept {
        0 => String::new(),
        kept => format!(", {kept} were there already"),
    };
    print::line(format_args!(
        "wrote {written} scans to {} in {wall_s:.1} s ({:.1} scans/s{kept}): {} scans, {:.0} m, {:.0} s",
        arguments.out.display(),
        written as f64 / wall_s,
        summary.scans,
        summary.path_m,
        summary.duration_s,
    ))
}

fn overrides(arguments: &SimulateArguments) -> Result<Vec<String>, Failure> {
    let file = arguments.trajectory.as_deref().map(path_value);
    let options = [
        ("scans", arguments.scans.map(|it| it.to_string())),
        ("seed", arguments.seed.map(|it| it.to_string())),
        ("output.format", arguments.format.map(|it| it.to_string())),
        ("drive.file", file.transpose()?.map(|it| it.to_string())),
    ];
    let given = options.into_iter().filter_map(|(key, value)| {
        let value = value?;
        Some(format!("simulation.{key}={value}"))
    });
    Ok(arguments.set.iter().cloned().chain(given).collect())
}

/// Renders a recording for `gyre stress`, and replaces the recording of an earlier test.
pub fn replace(simulation: &SimulationConfig, out: &Path) -> Result<(), Failure> {
    match write(simulation, out) {
        Err(SimulatorError::OtherFiles(_)) => {
            remove_dataset(out).map_err(|error| {
                format!("cannot replace the recording of an earlier test: {error}, which is another --out")
            })?;
            write(simulation, out)?;
        }
        result => {
            result?;
        }
    }
    Ok(())
}

fn write(simulation: &SimulationConfig, out: &Path) -> Result<Summary, SimulatorError> {
    let mut bar = None;
    let summary = write_dataset(simulation, out, &mut |done, total| {
        let bar = bar.get_or_insert_with(|| Bar::new(Some(total)));
        bar.scans(done as u64, done as u64, "simulated".to_owned());
    });
    bar.iter().for_each(Bar::finish);
    summary
}
