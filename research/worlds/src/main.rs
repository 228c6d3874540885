//! `gyre-worlds`: writes the recording of a simulated drive, which every command of Gyre reads.

use std::{
    error::Error,
    fs,
    num::NonZeroUsize,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Parser;
use gyre_worlds::{OutputFormat, SimulationConfig, drive::DriveKind, write_dataset_on};
use toml::{Table, Value};

/// Writes the recording of a simulated drive, or completes one.
#[derive(Parser)]
struct Arguments {
    /// A configuration; only its section [simulation] is read. Default: the defaults.
    configuration: Option<PathBuf>,
    /// The folder of the recording.
    #[arg(long)]
    out: PathBuf,
    /// Number of scans (simulation.scans).
    #[arg(long)]
    scans: Option<usize>,
    /// Seed (simulation.seed).
    #[arg(long)]
    seed: Option<u64>,
    /// The format of the files: oxford, boreas or radiate (simulation.output.format).
    #[arg(long)]
    format: Option<OutputFormat>,
    /// A trajectory to drive along (simulation.drive.file).
    #[arg(long)]
    trajectory: Option<PathBuf>,
    /// Threads that render. Default: one for each processor.
    #[arg(long)]
    threads: Option<NonZeroUsize>,
    /// Override a key, as in simulation.drive.speed_mps=5; may be repeated.
    #[arg(long)]
    set: Vec<String>,
}

fn main() -> ExitCode {
    match write(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("gyre-worlds: {error}");
            ExitCode::FAILURE
        }
    }
}

fn write(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let config = simulation(arguments)?;
    let threads = arguments
        .threads
        .or(std::thread::available_parallelism().ok());
    let threads = threads.unwrap_or(NonZeroUsize::MIN);
    let summary = write_dataset_on(threads, &config, &arguments.out, &mut |_, _| ())?;
    println!(
        "wrote {} scans to {}, {} were there already: {:.0} m, {:.0} s",
        summary.scans - summary.kept,
        arguments.out.display(),
        summary.kept,
        summary.path_m,
        summary.duration_s,
    );
    Ok(())
}

/// Returns the simulation of the configuration with all overrides.
fn simulation(arguments: &Arguments) -> Result<SimulationConfig, Box<dyn Error>> {
    let mut table = Table::new();
    if let Some(path) = &arguments.configuration {
        let text = fs::read_to_string(path)
            .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        table = text
            .parse()
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(Value::Table(simulation)) = table.get_mut("simulation") {
            in_folder(simulation, "drive", "file", folder);
            in_folder(simulation, "town", "streets", folder);
        }
    }
    for sentence in &arguments.set {
        set(&mut table, sentence)
            .ok_or_else(|| format!("`{sentence}` is not of the form simulation.KEY=VALUE"))?;
    }
    let section = table
        .remove("simulation")
        .unwrap_or(Value::Table(Table::new()));
    let mut config: SimulationConfig = section.try_into()?;
    config.scans = arguments.scans.or(config.scans);
    config.seed = arguments.seed.unwrap_or(config.seed);
    config.output.format = arguments.format.or(config.output.format);
    if let Some(file) = &arguments.trajectory {
        (config.drive.kind, config.drive.file) = (DriveKind::File, Some(file.clone()));
    }
    Ok(config)
}

/// Takes the relative paths of a key, one or a list, from the folder of their configuration.
fn in_folder(simulation: &mut Table, section: &str, key: &str, folder: &Path) {
    let section = simulation.get_mut(section).and_then(Value::as_table_mut);
    let Some(value) = section.and_then(|section| section.get_mut(key)) else {
        return;
    };
    let join = |value: &mut Value| {
        let joined = value
            .as_str()
            .map(|name| folder.join(name).display().to_string());
        if let Some(joined) = joined {
            *value = Value::String(joined);
        }
    };
    match value {
        Value::Array(all) => all.iter_mut().for_each(join),
        one => join(one),
    }
}

/// Sets a key; the value is TOML, or else a plain string.
fn set(table: &mut Table, sentence: &str) -> Option<()> {
    let (path, text) = sentence.split_once('=')?;
    let parsed = format!("value = {text}").parse::<Table>().ok();
    let value = parsed.and_then(|mut table| table.remove("value"));
    let (sections, last) = path.trim().rsplit_once('.')?;
    let mut place = table;
    for section in sections.split('.') {
        let entry = place.entry(section).or_insert_with(|| Table::new().into());
        place = entry.as_table_mut()?;
    }
    place.insert(last.to_owned(), value.unwrap_or_else(|| text.trim().into()));
    Some(())
}
