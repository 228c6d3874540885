//! `gyre calibrate`: finds the constants of a radar from a drive alone.

use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

use gyre_calibration::{Configured, Drive, Found, calibrate as solve, svg, toml};
use gyre_configuration::{Configuration, Played, describe_masks};
use gyre_radar::{DatasetOptions, OwnedScan, SweepGeometry};
use gyre_storage as storage;
use gyre_terminal::{Failure, print};

use crate::cli::CalibrateArguments;

/// The section for the configuration.
const SECTION: &str = "calibration.toml";
/// The picture.
const PICTURE: &str = "calibration.svg";
/// Time between two lines of progress.
const EVERY: Duration = Duration::from_secs(5);

/// Finds the constants, prints them, and writes `calibration.toml` and `calibration.svg`.
///
/// # Errors
/// A recording or a configuration that cannot be used, a drive that does not determine the
/// constants, a file that cannot be written.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<ExitCode, Failure> {
    let configuration = arguments.inputs.configuration()?;
    storage::create_folder(&arguments.out)?;
    let started = Instant::now();
    let (drive, geometry) = read(&configuration, arguments)?;
    print::note("comparing the scans");
    let calibration = solve(&drive)?;
    let configured = Configured {
        geometry,
        eccentricity_rad: options(&configuration)?
            .azimuth_eccentricity_rad
            .unwrap_or(0.0)
            .into(),
        min_range_m: configuration.odometry.points.min_range_m.into(),
        distance_m: arguments.distance_m,
    };
    let found = Found::new(&drive, &calibration, &configured)?;
    print::line(&found)?;
    let (section, picture) = (arguments.out.join(SECTION), arguments.out.join(PICTURE));
    storage::write(&section, toml(&found))?;
    storage::write(&picture, svg(&drive, &calibration))?;
    print::line(format_args!(
        "{:.0} s; {} for `gyre run --calibration`, {}",
        started.elapsed().as_secs_f64(),
        section.display(),
        picture.display()
    ))?;
    print::line(found.overlap())?;
    Ok(ExitCode::SUCCESS)
}

/// The options of the dataset, with those of the recording's own `dataset.toml`.
fn options(configuration: &Configuration) -> Result<DatasetOptions, Failure> {
    let own = configuration.dataset;
    match configuration.streamed() {
        Some(_) => Ok(own),
        None => Ok(own.or(&gyre_recording::stored_options(&configuration.source.data)?)),
    }
}

/// Registers the scans of a recording, as many as are asked for at most.
fn read(
    configuration: &Configuration,
    arguments: &CalibrateArguments,
) -> Result<(Drive, SweepGeometry), Failure> {
    let Played { mut dataset, .. } = gyre_configuration::open(configuration)?;
    describe_masks(configuration)?.iter().for_each(print::note);
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut drive = Drive::new(&configuration.odometry)?;
    let played = configuration.source.played(dataset.as_ref());
    let (all, count) = (played.len(), played.len().min(arguments.scans));
    if count < all {
        let sentence =
            format!("only the first {count} of {all} scans are used: --scans {all} takes them all");
        if arguments.distance_m.is_some() {
            return Err(format!("{sentence}, which --distance-m needs").into());
        }
        print::note(sentence);
    }
    let mut last_line = Instant::now();
    for (done, number) in played.take(count).enumerate() {
        let pushed = match dataset.read(number, scan.slot()) {
            Ok(geometry) => {
                scan.geometry = geometry;
                drive.push(number, &scan).map_err(|error| error.to_string())
            }
            Err(error) => Err(error.to_string()),
        };
        if let Err(reason) = pushed {
            print::note(format_args!("left out scan {number}: {reason}"));
        }
        if last_line.elapsed() >= EVERY {
            print::note(format_args!("read {done} of {count} scans"));
            last_line = Instant::now();
        }
    }
    Ok((drive, scan.geometry))
}
