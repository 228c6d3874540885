//! The command line of `gyre evaluate`.

use std::{num::NonZeroUsize, ops::Range, path::PathBuf};

use clap::Args;

/// The arguments of `gyre evaluate`.
#[derive(Debug, PartialEq, Args)]
pub struct EvaluateArguments {
    /// The trajectory to evaluate: the folder of a run's results, or a file in TUM, KITTI, or a
    /// dataset's own format.
    pub estimate: PathBuf,
    /// The ground truth: the folder of a recording that has one, or a file in TUM, KITTI, Oxford
    /// radar_odometry.csv, Boreas radar_poses.csv, MulRan global_pose.csv. Default: that of the
    /// run.
    pub ground_truth: Option<PathBuf>,
    /// Compare a run with itself and with the sensors beside the radar, as where there is no ground
    /// truth: the exit code is 1 if the result is bad.
    #[arg(long)]
    pub alone: bool,
    /// Evaluate the objects of a run against those of the recording that is named in the place of
    /// the ground truth, a simulated one: its objects.csv and its ground_truth.tum.
    #[arg(long, conflicts_with_all = ["find_time_offset", "plots", "odometry"])]
    pub objects: bool,
    /// Find the time by which the clock of the ground truth differs, from the speeds and yaw rates
    /// of both, and take it out (UTC and GPS time: 18 s, UTC and TAI: 37 s).
    #[arg(long)]
    pub find_time_offset: bool,
    /// Poses between the starts of the segments that are measured.
    #[arg(long, default_value = "10")]
    pub step: NonZeroUsize,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Write trajectory.svg, errors.svg and, where there are covariances, bands.svg here.
    #[arg(long)]
    pub plots: Option<PathBuf>,
    /// The motions whose covariances are evaluated. Default: the odometry.csv beside the estimate,
    /// if it has the same stamps.
    #[arg(long)]
    pub odometry: Option<PathBuf>,
    /// Lengths, in motions, of the segments over which covariances are evaluated.
    #[arg(long, value_delimiter = ',', default_value = "1,4,16,64")]
    pub nees_lengths: Vec<NonZeroUsize>,
    /// The part of the drive whose covariances are evaluated: all, or from A to B percent of its
    /// time as in 0..50. Scales that are tuned on one part can be validated on another.
    #[arg(long, value_name = "A..B", default_value = "all", value_parser = part)]
    pub nees_part: Range<f64>,
    /// Standard deviation of the ground truth's x and y, m: added to the covariances that are
    /// evaluated.
    #[arg(long, default_value = "0", value_parser = sigma)]
    pub truth_sigma_m: f64,
    /// Standard deviation of the ground truth's heading, degrees.
    #[arg(long, default_value = "0", value_parser = sigma)]
    pub truth_sigma_deg: f64,
}

/// Parses a standard deviation: a number, not below zero.
fn sigma(text: &str) -> Result<f64, String> {
    let sigma = text
        .parse()
        .ok()
        .filter(|sigma: &f64| sigma.is_finite() && *sigma >= 0.0);
    sigma.ok_or_else(|| "a number of at least 0 is needed".to_owned())
}

/// Parses `all`, or `A..B` in percent.
fn part(text: &str) -> Result<Range<f64>, String> {
    let share = |percent: &str| percent.parse::<f64>().ok().map(|percent| percent / 100.0);
    let range = || {
        let (from, to) = text.split_once("..")?;
        let (from, to) = (share(from)?, share(to)?);
        (0.0 <= from && from < to && to <= 1.0).then_some(from..to)
    };
    match text {
        "all" => Ok(0.0..1.0),
        _ => range().ok_or_else(|| {
            "`all` or a range of percent from 0..100 is needed, as in 0..50".to_owned()
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_a_range_of_percent() {
        assert_eq!((part("all"), part("0..50")), (Ok(0.0..1.0), Ok(0.0..0.5)));
        for text in ["50..50", "60..50", "-10..50", "0..110", "nan..100", "50"] {
            assert!(part(text).is_err(), "{text}");
        }
    }
}
