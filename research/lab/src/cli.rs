//! The command line.

use std::{num::NonZeroUsize, path::PathBuf};

use clap::{Args, Parser, Subcommand};

use crate::{
    corrupt::CorruptArguments, gnss::GnssArguments, localisation::LocalisationArguments,
    places::PlacesArguments, sequence::SequenceArguments, slam::SlamArguments,
};

/// Gyre's laboratory: what research on radar odometry needs, and a robot does not.
///
/// It runs the product's `target/release/gyre`, or the program that GYRE_PROGRAM names, which has
/// to be of the same state.
#[derive(Debug, Parser)]
#[command(version, about)]
pub struct Lab {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Print Fast-MbyM's Table III for this machine: the times of the searches, and the accuracy
    /// that they reach.
    Tables(TablesArguments),
    /// Measure what each step from the paper's form to a configuration gives, or what single
    /// changes of it do.
    Ablation(AblationArguments),
    /// Write a copy of a recording in which some scans are corrupted, to see what an odometry makes
    /// of them.
    Corrupt(CorruptArguments),
    /// Write rasters with their true poses into one memory-mappable file, to train masks on.
    ExportPairs(ExportPairsArguments),
    /// Measure how well the places of a run are recognised, and its loops verified.
    Places(PlacesArguments),
    /// Close the loops of a run, correct its trajectory, and compare both with the ground truth.
    Slam(SlamArguments),
    /// Cut holes out of the fixes of GNSS of a run, and measure how SLAM bridges them.
    Gnss(GnssArguments),
    /// Measure localisation in a map: the first fix by each scan alone, whole and half hidden, and
    /// tracking.
    Localisation(LocalisationArguments),
}

#[derive(Debug, Args)]
pub struct TablesArguments {
    /// The sequences. Times are measured on scans of the first.
    #[command(flatten)]
    pub sequences: SequenceArguments,
    /// The folder of tables.md, tables.json and all runs.
    #[arg(long, default_value = "out/tables")]
    pub out: PathBuf,
    /// Measure the times only (Table IIIa).
    #[arg(long)]
    pub times: bool,
    /// Rasters' sides whose times are measured, cells.
    #[arg(long, value_delimiter = ',', default_value = "127,255,511")]
    pub sizes: Vec<usize>,
    /// Timed passes of each search, once before the baseline and once after it.
    #[arg(long, default_value = "25")]
    pub passes: NonZeroUsize,
    /// A Python interpreter with torch: the baseline is timed between the two.
    #[arg(long, value_name = "PYTHON", requires = "baseline_script")]
    pub baseline: Option<PathBuf>,
    /// The baseline's program.
    #[arg(long, value_name = "FILE", requires = "baseline")]
    pub baseline_script: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct AblationArguments {
    /// The sequences.
    #[command(flatten)]
    pub sequences: SequenceArguments,
    /// The folder of ablation.md, ablation.json and all runs.
    #[arg(long, default_value = "out/ablation")]
    pub out: PathBuf,
    /// Run each of these changes alone instead of the steps, as in masking.threshold=50,70: shows
    /// whether a choice holds among its neighbours; may be repeated.
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub vary: Vec<String>,
}

#[derive(Debug, Args)]
pub struct ExportPairsArguments {
    /// The configuration, a TOML file: its raster, masking, rotation and translation.
    pub configuration: PathBuf,
    /// A recording's folder; may be repeated. Default: the configuration's simulation, or its
    /// source.data.
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
