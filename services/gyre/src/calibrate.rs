//! `gyre calibrate`: finds the constants of a radar from a drive alone.
//!
//! - `found`: the constants beside the configured ones, with what each rests on;
//! - `section`: `calibration.toml`, for `gyre run --calibration`;
//! - `picture`: `calibration.svg`, a place seen twice before and after.

mod found;
mod picture;
mod section;

use std::{
    path::Path,
    process::ExitCode,
    time::{Duration, Instant},
};

use gyre_calibration::{Drive, calibrate as solve};
use gyre_configuration::strict::{self, syntax};
use gyre_radar::{DatasetOptions, OwnedScan, SweepGeometry};
use gyre_storage as storage;

use crate::{
    Failure,
    cli::CalibrateArguments,
    configuration::Configuration,
    preflight::{self, Played},
    print,
};
use found::Found;

/// The section for the configuration.
const SECTION: &str = "calibration.toml";
/// The picture.
const PICTURE: &str = "calibration.svg";
/// Time between two lines of progress.
const EVERY: Duration = Duration::from_secs(5);

/// The configuration of the drive before it is calibrated.
pub(crate) struct Configured {
    /// The constants by which the scans were read.
    pub geometry: SweepGeometry,
    pub eccentricity_rad: f64,
    pub min_range_m: f64,
    /// Length of the path by another sensor, m.
    pub distance_m: Option<f64>,
}

/// Finds the constants, prints them, and writes `calibration.toml` and `calibration.svg`.
///
/// # Errors
/// A recording or a configuration that cannot be used, a drive that does not determine the
/// constants, a file that cannot be written.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<ExitCode, Failure> {
    let configuration = match (&arguments.config, &arguments.data) {
        (Some(path), _) => Configuration::read(path, &arguments.set)?,
        (None, Some(data)) => Configuration::of_recording(data, &arguments.set)?,
        (None, None) => Configuration::of_overrides(&arguments.set)?,
    }
    .streaming(arguments.data.as_deref());
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
    storage::write(&section, section::toml(&found))?;
    storage::write(&picture, picture::svg(&drive, &calibration))?;
    print::line(format_args!(
        "{:.0} s; {} for `gyre run --calibration`, {}",
        started.elapsed().as_secs_f64(),
        section.display(),
        picture.display()
    ))?;
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
    let Played { mut dataset, .. } = preflight::open(configuration)?;
    preflight::describe_masks(configuration)?;
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

/// Returns the section `[dataset]` of a file of `gyre calibrate` as overrides `dataset.key=value`.
///
/// # Errors
/// A file that cannot be read, or has anything else.
pub fn overrides(file: &Path) -> Result<Vec<String>, Failure> {
    let unusable = |reason: String| format!("{}: {reason}", file.display());
    let text = storage::read_text(file, storage::SETTINGS)
        .map_err(|error| unusable(format!("cannot be read: {error}")))?;
    let table: toml::Table = text
        .parse()
        .map_err(|error: toml::de::Error| unusable(syntax(&text, &error)))?;
    let section = match table.get("dataset") {
        Some(toml::Value::Table(section)) if table.len() == 1 => section,
        _ => {
            return Err(unusable(
                "a calibration has the section [dataset] and no other: give the calibration.toml of `gyre calibrate`".to_owned(),
            )
            .into());
        }
    };
    strict::section::<DatasetOptions>(&mut table.clone(), "dataset")
        .map_err(|error| unusable(error.to_string()))?;
    Ok(section
        .iter()
        .map(|(key, value)| format!("dataset.{key}={value}"))
        .collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_calibration_overrides_the_dataset_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(SECTION);
        storage::write(
            &file,
            "[dataset]\nrange_offset_m = -0.31 # m\ndoppler_s = 0.049\n",
        )
        .unwrap();
        let mut keys = overrides(&file).unwrap();
        keys.sort();
        assert_eq!(
            keys,
            ["dataset.doppler_s=0.049", "dataset.range_offset_m=-0.31"]
        );
        storage::write(
            &file,
            "[dataset]\ndoppler_s = 0.049\n[points]\nmin_range_m = 7\n",
        )
        .unwrap();
        let refused = overrides(&file).unwrap_err().to_string();
        assert!(
            refused.contains("the section [dataset] and no other"),
            "{refused}"
        );
    }
}
