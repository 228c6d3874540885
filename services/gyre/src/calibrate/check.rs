//! The check of a calibration by the ground truth of the drive.

use gyre_calibration::{Found, toml};
use gyre_configuration::{Configuration, terminal::Failure};
use gyre_datasets::{DatasetOptions, ground_truth::read_trajectory};
use gyre_geometry::OwnedScan;
use gyre_matching::odometry::Odometry;
use gyre_radar::Trajectory;
use gyre_results::{judgement::judge, truth_of};

use super::{CalibrateArguments, sensors};

/// Returns the ATE by radar alone as configured and as found, m; `None` without a ground truth.
pub(super) fn ates_m(arguments: &CalibrateArguments, found: &Found) -> Option<[f64; 2]> {
    let mut configuration = arguments.inputs.configuration().ok()?;
    sensors::leave_out(&mut configuration.odometry.sensors);
    let truth = read_trajectory(&truth_of(&configuration, &arguments.out)?).ok()?;
    let before = ate_m(&configuration, arguments.scans, &truth).ok()?;
    let file: ::toml::Table = toml(found).parse().ok()?;
    let constants: DatasetOptions = file["dataset"].clone().try_into().ok()?;
    configuration.dataset = constants.or(&configuration.dataset);
    if let Some(min_range_m) = found.min_range_m {
        configuration.odometry.points.min_range_m = min_range_m as f32;
        configuration.odometry.raster.min_range_m = min_range_m as f32;
    }
    // If the drive cannot be registered with the constants, they are worse.
    let after = ate_m(&configuration, arguments.scans, &truth);
    Some([before, after.unwrap_or(f64::INFINITY)])
}

fn ate_m(configuration: &Configuration, scans: usize, truth: &Trajectory) -> Result<f64, Failure> {
    let mut dataset = gyre_configuration::open(configuration)?.dataset;
    let mut odometry = Odometry::new(&configuration.odometry)?;
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let (mut poses, mut stamps_ns) = (Vec::new(), Vec::new());
    for number in configuration.source.played(dataset.scans()).take(scans) {
        // What cannot be read was named when the drive was read.
        if let Ok(geometry) = dataset.read(number, scan.slot()) {
            scan.geometry = geometry;
            if let Ok(registered) = odometry.register(&scan.view(), &[]) {
                stamps_ns.push(geometry.stamp_ns);
                poses.push(registered.pose.motion);
            }
        }
    }
    let stamp_ns = Some(stamps_ns);
    let estimate = Trajectory { stamp_ns, poses };
    Ok(judge(&estimate, truth)?.ate.rmse_m)
}
