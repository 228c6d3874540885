//! The scans that a configuration names: a recording, or a simulation that is rendered while it is
//! read.

use std::{error::Error, path::Path};

use gyre_contract::run::PlayedFrom;
use gyre_datasets::{Dataset, Fingerprint, OpenError, SampleLog, ScanSamples, check_first_scan};
use gyre_geometry::samples::{DopplerConfig, SensorConfig, SensorKind};
use gyre_simulator::{SimulatedDrive, beside::Kind};

use crate::configuration::Configuration;

/// Why the scans of a configuration, or the logs of its sensors, cannot be read.
type Failure = Box<dyn Error + Send + Sync>;

fn refused<T>(reason: &str) -> Result<T, Failure> {
    Err(reason.into())
}

pub struct Played {
    pub dataset: Box<dyn Dataset>,
    /// `ground_truth.tum` of a simulation.
    pub truth: Option<Vec<u8>>,
    pub samples: ScanSamples,
}

pub fn open(configuration: &Configuration) -> Result<Played, Failure> {
    let (data, options) = (&configuration.source.data, &configuration.dataset);
    let method = &configuration.odometry;
    if configuration.is_radar() {
        let radar = configuration.data();
        return refused(&format!(
            "the configuration is of {radar}, but this needs a recording: name one"
        ));
    }
    let drive = configuration.simulation.as_ref().map(SimulatedDrive::new);
    let drive = drive.transpose()?;
    let mut dataset = match &drive {
        Some(drive) => drive.open(options)?,
        None if data.as_os_str().is_empty() => {
            return refused(
                "no dataset is named: name its folder, or source.data in the configuration, or add a section [simulation]",
            );
        }
        None => gyre_recording::open(data, options)?,
    };
    check_first(configuration, dataset.as_ref())?;
    check_doppler(&method.sensors.doppler, dataset.as_mut())?;
    let sensors = method.sensors.sampled();
    Ok(Played {
        samples: match &drive {
            Some(drive) => simulated_samples(drive, &sensors, dataset.as_mut())?,
            None => ScanSamples::open(&sensors, data, dataset.as_mut())?,
        },
        dataset,
        truth: drive.map(|drive| drive.ground_truth_tum()),
    })
}

fn check_first(configuration: &Configuration, dataset: &dyn Dataset) -> Result<(), Failure> {
    let (first, scans) = (configuration.source.first, dataset.scans());
    match first >= scans.end && !scans.is_empty() {
        true => refused(&format!(
            "source.first is {first}, but {} has {} scans, from {} to {}: give a smaller one",
            configuration.data(),
            scans.len(),
            scans.start,
            scans.end - 1
        )),
        false => Ok(()),
    }
}

/// Checks that the radar reports its velocity by Doppler, if Doppler is used.
fn check_doppler(doppler: &DopplerConfig, dataset: &mut dyn Dataset) -> Result<(), Failure> {
    match doppler.is_used().then(|| check_first_scan(dataset)) {
        Some(Err(reason)) => refused(&format!(
            "doppler.kind is `auto`, but {reason}; with doppler.kind = \"none\" it is not used"
        )),
        _ => Ok(()),
    }
}

/// Returns the samples that go with the scans of a simulation: of its own sensors, unless other
/// logs are named.
pub fn simulated_samples(
    drive: &SimulatedDrive,
    sensors: &[&dyn SensorConfig],
    dataset: &mut dyn Dataset,
) -> Result<ScanSamples, Failure> {
    sensors.iter().try_fold(ScanSamples::None, |all, sensor| {
        if sensor.kind() != SensorKind::Auto {
            return Ok(all.and(ScanSamples::open(&[*sensor], Path::new(""), dataset)?));
        }
        let of = sensor.of();
        let Some(samples) = drive.samples(of) else {
            let none = Kind::of(of).map_or("none", |kind| kind.lacks);
            let of = of.section();
            return refused(&format!(
                "{of}.kind is `auto`, but the simulation has {none} in [simulation.{of}], or set {of}.kind = \"none\""
            ));
        };
        let log = SampleLog::of(of, samples.into(), Path::new("simulation"))?;
        Ok(all.and(ScanSamples::of_log(&log, *sensor, dataset)?))
    })
}

/// Returns the log of the fixes that the corrected trajectory is made with, of a run with its
/// results in `out`; `None` without GNSS.
pub fn gnss_log(configuration: &Configuration, out: &Path) -> Result<Option<SampleLog>, Failure> {
    let (config, data) = (&configuration.gnss, &configuration.source.data);
    let is_in_folder = configuration.simulation.is_none() && !data.as_os_str().is_empty();
    match config.kind == SensorKind::Auto && !is_in_folder {
        true => refused(
            "gnss.kind is `auto`, but these scans lie in no folder, so that no log lies beside them: name one with gnss.kind = \"log\" and gnss.file, or set gnss.kind = \"none\"",
        ),
        false => Ok(gyre_recording::gnss_log(config, data, out)?),
    }
}

/// Returns the configuration with the options of the recording's `dataset.toml` where it has none.
pub fn with_stored_options(configuration: &Configuration) -> Result<Configuration, OpenError> {
    let mut resolved = configuration.clone();
    let data = &configuration.source.data;
    if configuration.simulation.is_none() && !data.as_os_str().is_empty() {
        let stored = gyre_recording::stored_options(data)?;
        resolved.dataset = resolved.dataset.or(&stored);
    }
    Ok(resolved)
}

/// Returns the identification of a recording; `None`: its configuration does.
pub fn fingerprint(configuration: &Configuration) -> Result<Option<Fingerprint>, Failure> {
    let plays_scans = configuration.source.from == PlayedFrom::Scan && !configuration.is_radar();
    if !plays_scans || configuration.simulation.is_some() {
        return Ok(None);
    }
    let played = open(configuration)?;
    Ok(Some(Fingerprint::of(played.dataset.as_ref())?))
}
