//! The check of a calibration: odometry as configured and with the constants that were found, by
//! the ground truth of the drive.

use std::{fmt, path::Path};

use gyre_calibration::{Found, toml};
use gyre_configuration::Configuration;
use gyre_datasets::{DatasetOptions, ground_truth::read_trajectory};
use gyre_odometry::Odometry;
use gyre_radar::{OwnedScan, Trajectory};
use gyre_results::{judgement::judge, truth_of};
use gyre_samples::{GyroKind, WheelsKind};
use gyre_terminal::{Failure, print};

use crate::cli::CalibrateArguments;

/// The ATE of a drive as configured and with what was found, m.
pub(super) struct Check([f64; 2]);

impl Check {
    /// Registers the first scans of a drive twice by radar alone, and compares both with the ground
    /// truth; `None` without one that can be used.
    pub(super) fn of(
        configuration: &Configuration,
        found: &Found,
        arguments: &CalibrateArguments,
    ) -> Option<Self> {
        let truth = truth_of(configuration, &arguments.out).filter(|it| it.is_file())?;
        let note = |reason: &Failure| print::note(format_args!("no check by the truth: {reason}"));
        let both = ates_m(configuration, found, arguments.scans, &truth).inspect_err(note);
        both.ok().map(Self)
    }

    /// Returns whether the constants that were found make the trajectory worse.
    pub(super) fn is_worse(&self) -> bool {
        self.0[1] > self.0[0]
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [before, after] = self.0;
        let verdict = match self.is_worse() {
            true => "is NOT better: keep the configuration",
            false => "is better",
        };
        write!(
            f,
            "ATE {before:.3} m as configured, {after:.3} m with the file, which {verdict}"
        )
    }
}

fn ates_m(
    configuration: &Configuration,
    found: &Found,
    scans: usize,
    truth: &Path,
) -> Result<[f64; 2], Failure> {
    let (truth, mut changed) = (read_trajectory(truth)?, configuration.clone());
    let file: ::toml::Table = toml(found).parse()?;
    let constants: DatasetOptions = file["dataset"].clone().try_into()?;
    changed.dataset = constants.or(&configuration.dataset);
    if let Some(min_range_m) = found.min_range_m {
        changed.odometry.points.min_range_m = min_range_m as f32;
        changed.odometry.raster.min_range_m = min_range_m as f32;
    }
    let [before, after] = [configuration, &changed].map(|it| ate_m(it, scans, &truth));
    Ok([before?, after?])
}

fn ate_m(configuration: &Configuration, scans: usize, truth: &Trajectory) -> Result<f64, Failure> {
    let mut dataset = gyre_configuration::open(configuration)?.dataset;
    let mut config = configuration.odometry.clone();
    (config.gyro.kind, config.wheels.kind) = (GyroKind::None, WheelsKind::None);
    let mut odometry = Odometry::new(&config)?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let (mut estimate, mut stamps_ns) = (Trajectory::default(), Vec::new());
    for number in configuration.source.played(dataset.scans()).take(scans) {
        // What cannot be read was counted when the drive was read.
        let Ok(geometry) = dataset.read(number, scan.slot()) else {
            continue;
        };
        scan.geometry = geometry;
        if let Ok(registered) = odometry.register(&scan.view(), &[]) {
            stamps_ns.push(geometry.stamp_ns);
            estimate.poses.push(registered.pose.motion);
        }
    }
    estimate.stamp_ns = Some(stamps_ns);
    Ok(judge(&estimate, truth, Default::default())?.ate.rmse_m)
}
