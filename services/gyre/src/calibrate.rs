//! `gyre calibrate`: finds the constants of a radar from drives alone.

use std::{
    path::Path,
    process::ExitCode,
    time::{Duration, Instant},
};

use gyre_calibration::{Configured, Drive, Study, svg, toml};
use gyre_configuration::{Configuration, Played, describe_masks_in_process};
use gyre_radar::{DatasetOptions, OwnedScan, SweepGeometry};
use gyre_storage as storage;
use gyre_terminal::{Failure, print};

use crate::cli::CalibrateArguments;

/// The section for the configuration.
const SECTION: &str = "calibration.toml";
/// The picture of the first drive.
const PICTURE: &str = "calibration.svg";
/// Time between two lines of progress.
const EVERY: Duration = Duration::from_secs(5);

/// Finds the constants, prints them, and writes `calibration.toml`, and a picture of each drive.
///
/// # Errors
/// A recording or a configuration that cannot be used, a drive that does not determine the
/// constants, drives that are read with different ones, a file that cannot be written.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let section = arguments.out.join(SECTION);
    storage::create_folder(&arguments.out)?;
    let first = Recorded::read(&arguments.inputs.configuration()?, arguments)?;
    let others = arguments.with.iter().map(|data| {
        let configuration = arguments.inputs.configuration_with(data)?;
        let other = Recorded::read(&configuration, arguments)?;
        first.require_same_constants(&other)?;
        Ok(other)
    });
    let others: Vec<_> = others.collect::<Result<_, Failure>>()?;
    let first = first.study(&arguments.out.join(PICTURE))?;
    let others = others.into_iter().enumerate().map(|(k, other)| {
        let picture = format!("calibration-{}.svg", k + 2);
        other.study(&arguments.out.join(picture))
    });
    let others: Vec<_> = others.collect::<Result<_, _>>()?;
    let found = match others.is_empty() {
        true => first.found,
        false => {
            let found = first.combined(&others)?;
            print::line(format_args!("all together: {found}"))?;
            found
        }
    };
    storage::write(&section, toml(&found))?;
    print::line(format_args!(
        "{:.0} s; {} for `gyre run --calibration`, {PICTURE} beside it",
        started.elapsed().as_secs_f64(),
        section.display(),
    ))?;
    print::line(found.overlap())?;
    Ok(ExitCode::SUCCESS)
}

/// A drive as it was read.
struct Recorded {
    name: String,
    drive: Drive,
    configured: Configured,
}

impl Recorded {
    /// Registers the scans of a recording, as many as are asked for at most.
    fn read(
        configuration: &Configuration,
        arguments: &CalibrateArguments,
    ) -> Result<Self, Failure> {
        let (drive, geometry) = read(configuration, arguments)?;
        let eccentricity_rad = options(configuration)?.azimuth_eccentricity_rad;
        Ok(Self {
            name: configuration.data(),
            drive,
            configured: Configured {
                geometry,
                eccentricity_rad: eccentricity_rad.unwrap_or(0.0).into(),
                min_range_m: configuration.odometry.points.min_range_m.into(),
                distance_m: arguments.distance_m,
            },
        })
    }

    /// Refuses another drive that was read with other constants: what it says is a change of those.
    fn require_same_constants(&self, other: &Self) -> Result<(), Failure> {
        let constants = [self, other].map(|it| {
            let geometry = &it.configured.geometry;
            [
                ("range_resolution_m", geometry.range_resolution_m),
                ("range_offset_m", geometry.range_offset_m),
                ("doppler_s", geometry.doppler_s),
                (
                    "azimuth_eccentricity_rad",
                    it.configured.eccentricity_rad as f32,
                ),
            ]
        });
        let mut both = constants[0].iter().zip(constants[1]);
        match both.find(|(one, another)| one.1 != another.1) {
            None => Ok(()),
            Some(((key, one), (_, another))) => Err(format!(
                "{} is read with {key} = {one} and {} with {another}, which is not one radar: set dataset.{key}",
                self.name, other.name
            )
            .into()),
        }
    }

    /// Finds the constants, prints them, and draws the drive.
    fn study(self, picture: &Path) -> Result<Study, Failure> {
        print::note(format_args!("comparing the scans of {}", self.name));
        let study = Study::new(self.drive, &self.configured)?;
        print::line(format_args!("{}: {}", self.name, study.found))?;
        storage::write(picture, svg(&study.drive, &study.calibration))?;
        Ok(study)
    }
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
    describe_masks_in_process(configuration)?
        .iter()
        .for_each(print::note);
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
