//! The command line.

use std::{num::NonZeroUsize, path::PathBuf};

use clap::{Args, Parser, Subcommand};

use crate::corrupt::Fault;

/// Gyre's laboratory: what research on radar odometry needs, and a robot does not.
///
/// It has all commands of `gyre` as well, so that whatever it runs is of the same build.
#[derive(Debug, Parser)]
#[command(version, about)]
pub struct Lab {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Print the papers' tables for this machine: times of the searches, and the accuracy that they reach.
    Tables(TablesArguments),
    /// Measure how like real scans simulated ones are.
    Realism(RealismArguments),
    /// Write a copy of a recording in which some scans are corrupted, to see what an odometry makes of them.
    Corrupt(CorruptArguments),
    /// Write rasters with their true poses into one memory-mappable file, to train masks on.
    ExportPairs(ExportPairsArguments),
    /// A command of `gyre`.
    #[command(flatten)]
    Gyre(gyre::cli::Command),
}

#[derive(Debug, Args)]
pub struct TablesArguments {
    /// A sequence's configuration; one for each --data, in the same order.
    #[arg(long = "config", required = true)]
    pub configurations: Vec<PathBuf>,
    /// A sequence's folder; may be repeated. Times are measured on scans of the first.
    #[arg(long, required = true)]
    pub data: Vec<PathBuf>,
    /// Where tables.md, tables.json and all runs go.
    #[arg(long, default_value = "out/tables")]
    pub out: PathBuf,
    /// The folder of the learned masks: f-mbym-N.toml and mbym-N.toml for rasters of N cells a side, gyre-255.toml for Gyre's
    /// own rows. A row whose model is not there is left out, and so it is said.
    #[arg(long, default_value = "models")]
    pub models: PathBuf,
    /// Also run with each of these changes alone, as in masking.threshold=50,70: what the choice is worth among its
    /// neighbours; may be repeated.
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub vary: Vec<String>,
    /// Also run each step from the paper's form to the configuration as it is, each with those before it.
    #[arg(long)]
    pub ladder: bool,
    /// Leave Table III out, times and accuracy: only what --ladder and --vary ask for.
    #[arg(long)]
    pub no_table_iii: bool,
    /// Rasters' sides whose times are measured, cells.
    #[arg(long, value_delimiter = ',', default_value = "127,255,511")]
    pub sizes: Vec<usize>,
    /// Timed passes of each search, once before the peer and once after it.
    #[arg(long, default_value = "25")]
    pub passes: NonZeroUsize,
    /// A Python interpreter with torch: the peer is timed between the two.
    #[arg(long, requires = "peer_script")]
    pub peer: Option<PathBuf>,
    /// The peer's program.
    #[arg(long, requires = "peer")]
    pub peer_script: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct RealismArguments {
    /// The simulated recording's folder.
    pub sim: PathBuf,
    /// The real recording's folder.
    pub real: PathBuf,
    /// Another real recording: says of each statistic whether SIM is closer to REAL than this one is.
    #[arg(long, value_name = "OTHER")]
    pub between: Option<PathBuf>,
    /// SIM's configuration. Default, for each recording: the one that ships for its format.
    #[arg(long, value_name = "FILE")]
    pub sim_config: Option<PathBuf>,
    /// REAL's configuration.
    #[arg(long, value_name = "FILE")]
    pub real_config: Option<PathBuf>,
    /// OTHER's configuration.
    #[arg(long, value_name = "FILE", requires = "between")]
    pub between_config: Option<PathBuf>,
    /// Where realism.md, realism.json, plots, pictures and the odometries' runs go.
    #[arg(long, default_value = "out/realism")]
    pub out: PathBuf,
    /// Scans whose statistics are taken, at most: runs of consecutive ones, evenly spread over the recording.
    #[arg(long, default_value = "64")]
    pub scans: NonZeroUsize,
    /// Scans that the odometries are run on, at most, from the first on; 0: run none.
    #[arg(long, default_value = "512")]
    pub search_scans: usize,
    /// Power above which something is there. Default: masking's.
    #[arg(long)]
    pub threshold: Option<u8>,
}

#[derive(Debug, Args)]
pub struct ExportPairsArguments {
    /// The configuration, a TOML file: its raster, masking, rotation and translation.
    pub configuration: PathBuf,
    /// A recording's folder; may be repeated. Default: the configuration's simulation, or its source.data.
    #[arg(long)]
    pub data: Vec<PathBuf>,
    /// The file to write, NAME.npy; NAME.toml beside it says what it was made of.
    #[arg(long)]
    pub out: PathBuf,
    /// The recording's ground truth (run.ground_truth). Default: what lies in its folder.
    #[arg(long, value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// Override a key, as in raster.n=127; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[derive(Debug, Args)]
pub struct CorruptArguments {
    /// The dataset's folder. The copy has links to it, and needs it.
    pub path: PathBuf,
    /// What is done: noise, later (the powers of the scan ten later), turned (by a quarter), half-blank, dropped.
    #[arg(long)]
    pub fault: Fault,
    /// Every so-manyth scan is spoilt, never the first.
    #[arg(long, default_value = "20")]
    pub every: NonZeroUsize,
    /// Seed of the noise.
    #[arg(long, default_value = "1")]
    pub seed: u64,
    /// Where to write the copy: an empty folder.
    #[arg(long)]
    pub out: PathBuf,
}
