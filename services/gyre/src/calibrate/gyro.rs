//! The gyro beside the scans of a drive: its log, and the radar's findings about the gyro.

use std::path::{Path, absolute};

use gyre_calibration::{Drive, GyroCalibration, GyroError, calibrate_gyro};
use gyre_configuration::Configuration;
use gyre_datasets::GyroLog;
use gyre_samples::{GyroConfig, GyroKind};
use gyre_terminal::{Failure, print};

use super::Section;

/// A log and the configuration of its gyro.
pub(super) struct Gyro {
    log: GyroLog,
    configured: GyroConfig,
    /// It was named, rather than found beside the scans.
    is_named: bool,
}

impl Gyro {
    /// Reads the log that is named, or else that which lies beside the scans. One that lies there
    /// and cannot be used is named, and left alone.
    pub(super) fn read(
        configuration: &Configuration,
        named: Option<&Path>,
    ) -> Result<Option<Self>, Failure> {
        let configured = &configuration.odometry.gyro;
        let configured_file = configured.file.as_deref();
        let configured_file = configured_file.filter(|_| configured.kind == GyroKind::Log);
        let named = named.or(configured_file);
        let of = |log| Self {
            log,
            configured: configured.clone(),
            is_named: named.is_some(),
        };
        if let Some(file) = named {
            return Ok(Some(of(GyroLog::read(file)?)));
        }
        let beside = GyroLog::find(&configuration.source.data).ok();
        let beside = beside.map(|file| GyroLog::read(&file));
        match beside.transpose() {
            Ok(log) => Ok(log.map(of)),
            Err(error) => {
                print::note(format_args!("the gyro is left alone: {error}"));
                Ok(None)
            }
        }
    }

    /// Finds the clock and the axes of the gyro by a drive, and prints them.
    fn calibrate(&self, drive: &Drive) -> Result<Result<GyroCalibration, GyroError>, Failure> {
        let track = drive.mean_track()?;
        let log = self.log.path.display();
        print::line(format_args!("{:<21} {log}", "gyro, log"))?;
        let max_gap_s = self.configured.max_gap_s;
        let found = calibrate_gyro(drive, &track, &self.log.samples, max_gap_s);
        match &found {
            Ok(found) => print::line(found.table(&self.configured))?,
            Err(error) => print::line(format_args!("{:<21} not told: {error}", ""))?,
        }
        Ok(found)
    }
}

/// Calibrates the gyro by the drives that have a log, and prints the findings.
pub(super) fn section(logs: &[(&Gyro, &Drive)]) -> Result<Section, Failure> {
    let Some((first, _)) = logs.first() else {
        return Ok(Section::default());
    };
    let (mut told, mut refused) = (Vec::new(), None);
    for (gyro, drive) in logs {
        match gyro.calibrate(drive)? {
            Ok(found) => told.push(found),
            Err(error) => refused = Some(error),
        }
    }
    let Some((one, others)) = told.split_first() else {
        return Ok(Section::refused("gyro is", refused, first.is_named));
    };
    let found = one.mean(others)?;
    if !others.is_empty() {
        let table = found.table(&first.configured);
        print::line(format_args!("gyro, all drives together\n{table}"))?;
    }
    // A relative path is one of the file's folder.
    let file = first.is_named.then(|| absolute(&first.log.path));
    Ok(Section::told(found.toml(file.transpose()?.as_deref())))
}
