//! The command line.

use std::{num::NonZeroUsize, path::PathBuf};

use clap::{Args, Parser, Subcommand};
use gyre_evaluation::Part;
use gyre_simulator::{Fault, OutputFormat};

use crate::configuration::Rate;

/// Radar odometry as cooperating processes over shared memory.
///
/// Turns the scans of a spinning FMCW radar into motion and a trajectory.
#[derive(Debug, Parser)]
#[command(version, about)]
pub struct Gyre {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the whole pipeline on a recording, and write a trajectory.
    Run(RunArguments),
    /// Run one process of a run (what `gyre run` starts).
    Stage {
        /// radar-replay, masking, rotation-search, translation-search, joint-search, refinement or pose-integration.
        name: String,
    },
    /// Say what a dataset is, and what looks wrong with it.
    Inspect(InspectArguments),
    /// Judge a trajectory by ground truth.
    Evaluate(EvaluateArguments),
    /// Draw what the mask keeps of scans.
    Masks(MasksArguments),
    /// Print the papers' tables for this machine: times of the searches, and the accuracy that they reach.
    Tables(TablesArguments),
    /// Measure how like real scans simulated ones are.
    Realism(RealismArguments),
    /// Write a simulated recording, or go on with one.
    Simulate(SimulateArguments),
    /// Write rasters with their true poses into one memory-mappable file, to train masks on.
    ExportPairs(ExportPairsArguments),
    /// Write a copy of a recording with some scans spoilt, to see what an odometry makes of them.
    Spoil(SpoilArguments),
}

#[derive(Debug, Args)]
pub struct RunArguments {
    /// The configuration, a TOML file.
    pub configuration: PathBuf,
    /// The dataset's folder (source.data).
    #[arg(long)]
    pub data: Option<PathBuf>,
    /// Where the results go. Default: `out/NAME`, NAME being the configuration's.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// How fast to play: realtime, max, or a factor (run.rate).
    #[arg(long)]
    pub rate: Option<Rate>,
    /// Override a key, as in masking.kind=none; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Forget an unfinished run in --out instead of going on with it.
    #[arg(long)]
    pub fresh: bool,
}

#[derive(Debug, Args)]
pub struct InspectArguments {
    /// The dataset's folder.
    pub path: PathBuf,
    /// A trajectory of this dataset (TUM), to find out whether each ground truth's clock agrees.
    #[arg(long)]
    pub trajectory: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct EvaluateArguments {
    /// The trajectory to judge: TUM, KITTI, or a dataset's own form.
    #[arg(long)]
    pub estimate: PathBuf,
    /// The ground truth: TUM, KITTI, Oxford radar_odometry.csv, Boreas radar_poses.csv, MulRan global_pose.csv.
    #[arg(long)]
    pub ground_truth: PathBuf,
    /// Poses between the starts of the stretches that are measured.
    #[arg(long, default_value = "10")]
    pub step: NonZeroUsize,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Write trajectory.svg, errors.svg and, where there are covariances, bands.svg here.
    #[arg(long)]
    pub plots: Option<PathBuf>,
    /// The motions whose covariances are judged. Default: the odometry.csv beside the estimate, if it has the same stamps.
    #[arg(long)]
    pub odometry: Option<PathBuf>,
    /// How many motions make the stretches over which covariances are judged.
    #[arg(long, value_delimiter = ',', default_value = "1,4,16,64")]
    pub nees_lengths: Vec<NonZeroUsize>,
    /// The part of the drive whose covariances are judged: all, or from A to B percent of its time as in 0..50. Scales that are set
    /// on one part can be shown on another.
    #[arg(long, value_name = "A..B", default_value = "all", value_parser = part)]
    pub nees_part: Part,
    /// Standard deviation of the ground truth's x and y, m: added to the covariances that are judged.
    #[arg(long, default_value = "0", value_parser = sigma)]
    pub truth_sigma_m: f64,
    /// Standard deviation of the ground truth's heading, degrees.
    #[arg(long, default_value = "0", value_parser = sigma)]
    pub truth_sigma_deg: f64,
}

#[derive(Debug, Args)]
pub struct MasksArguments {
    /// The configuration, a TOML file: its raster, masking and search.
    pub configuration: PathBuf,
    /// The recording's folder. Default: the configuration's simulation, or its source.data.
    #[arg(long)]
    pub data: Option<PathBuf>,
    /// Where masks.png and a scan-NUMBER.png for each go.
    #[arg(long, default_value = "out/masks")]
    pub out: PathBuf,
    /// Numbers of the scans to draw. Default: eight, evenly spread.
    #[arg(long, value_delimiter = ',')]
    pub scans: Vec<usize>,
    /// Draw every so-manyth scan.
    #[arg(long, conflicts_with = "scans")]
    pub every: Option<NonZeroUsize>,
    /// Override a key, as in masking.kind=threshold; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
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
pub struct SimulateArguments {
    /// The configuration, whose section `[simulation]` is used; its defaults without one.
    pub configuration: Option<PathBuf>,
    /// Where to write the recording. What an earlier call with the same configuration left there is kept and completed.
    #[arg(long)]
    pub out: PathBuf,
    /// How many scans (simulation.scans).
    #[arg(long)]
    pub scans: Option<usize>,
    /// Drive along this file: TUM, KITTI, Oxford radar_odometry.csv, Boreas radar_poses.csv.
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Seed (simulation.seed).
    #[arg(long)]
    pub seed: Option<u64>,
    /// Whose form of files: oxford, boreas or radiate (simulation.output.format).
    #[arg(long)]
    pub format: Option<OutputFormat>,
    /// Threads to render on. Default: all processors. The files are the same whatever their number.
    #[arg(long)]
    pub threads: Option<NonZeroUsize>,
    /// Override a key, as in simulation.drive.speed_mps=5; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
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
pub struct SpoilArguments {
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

/// A standard deviation: a number, not below zero.
fn sigma(text: &str) -> Result<f64, String> {
    let sigma = text
        .parse()
        .ok()
        .filter(|sigma: &f64| sigma.is_finite() && *sigma >= 0.0);
    sigma.ok_or_else(|| "a number of at least 0 is needed".to_owned())
}

/// `all`, or `A..B` in percent.
fn part(text: &str) -> Result<Part, String> {
    let share = |percent: &str| percent.parse::<f64>().ok().map(|percent| percent / 100.0);
    let range = || {
        let (from, to) = text.split_once("..")?;
        Part::new(share(from)?, share(to)?)
    };
    match text {
        "all" => Ok(Part::ALL),
        _ => range().ok_or_else(|| {
            "`all` or a range of percent from 0..100 is needed, as in 0..50".to_owned()
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_all_or_a_range_of_percent() {
        assert_eq!(part("all"), Ok(Part::ALL));
        assert_eq!(part("0..100"), Ok(Part::ALL));
        assert_eq!(part("12.5..50").ok(), Part::new(0.125, 0.5));
        for text in ["", "half", "50", "50..", "60..50", "0..101", "nan..50"] {
            assert!(part(text).is_err(), "{text}");
        }
    }
}
