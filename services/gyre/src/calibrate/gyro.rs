//! The gyro beside the scans of a drive: its log, and what the radar says of it.

use std::path::{Path, absolute};

use gyre_calibration::{Drive, GyroCalibration, GyroError, calibrate_gyro};
use gyre_configuration::Configuration;
use gyre_datasets::GyroLog;
use gyre_samples::{GyroConfig, GyroKind};
use gyre_terminal::{Failure, print};

/// A log, and what is configured of its gyro.
pub(super) struct Gyro {
    log: GyroLog,
    configured: GyroConfig,
    /// It was named, rather than found beside the scans.
    is_named: bool,
}

impl Gyro {
    /// Reads the log that is named, or else that which lies beside the scans. One that lies there
    /// and cannot be used is named, and left alone.
    ///
    /// # Errors
    /// A log that is named and cannot be used.
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
        let beside = GyroLog::beside(&configuration.source.data).map(|file| GyroLog::read(&file));
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

/// The part of the file that is of the gyro.
#[derive(Default)]
pub(super) struct Section {
    pub(super) text: String,
    pub(super) is_told: bool,
    /// Why the gyro of a log that was named is not calibrated.
    pub(super) refused: Option<Failure>,
}

impl Section {
    /// Calibrates the gyro by the drives that have a log, and prints what they say.
    ///
    /// # Errors
    /// Scans that cannot be registered; drives of which another axis points up.
    pub(super) fn of(logs: Vec<(&Gyro, &Drive)>) -> Result<Self, Failure> {
        let Some((first, _)) = logs.first().copied() else {
            return Ok(Self::default());
        };
        let (mut told, mut refused) = (Vec::new(), None);
        for (gyro, drive) in logs {
            match gyro.calibrate(drive)? {
                Ok(found) => told.push(found),
                Err(error) => refused = Some(error),
            }
        }
        let Some((one, others)) = told.split_first() else {
            let text = refused
                .as_ref()
                .map(|error| format!("\n# The gyro is not calibrated: {error}\n"));
            return Ok(Self {
                text: text.unwrap_or_default(),
                is_told: false,
                refused: refused.filter(|_| first.is_named).map(Into::into),
            });
        };
        let found = one.mean(others)?;
        if !others.is_empty() {
            let table = found.table(&first.configured);
            print::line(format_args!("gyro, all drives together\n{table}"))?;
        }
        // A relative path is one of the file's folder.
        let file = first.is_named.then(|| absolute(&first.log.path));
        Ok(Self {
            text: found.toml(file.transpose()?.as_deref()),
            is_told: true,
            refused: None,
        })
    }
}
