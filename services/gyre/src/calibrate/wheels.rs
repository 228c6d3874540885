//! The wheels beside the scans of a drive: their log, and the radar's findings about the wheels.

use std::path::{Path, absolute};

use gyre_calibration::{ClockError, Drive, WheelCalibration, calibrate_wheels};
use gyre_configuration::Configuration;
use gyre_datasets::WheelLog;
use gyre_samples::{WheelsConfig, WheelsKind};
use gyre_terminal::{Failure, print};

use super::Section;

/// A log and the configuration of its wheels.
pub(super) struct Wheels {
    log: WheelLog,
    configured: WheelsConfig,
    /// It was named, rather than found beside the scans.
    is_named: bool,
}

impl Wheels {
    /// Reads the log that is named, or else that which lies beside the scans. One that lies there
    /// and cannot be used is named, and left alone.
    pub(super) fn read(
        configuration: &Configuration,
        named: Option<&Path>,
    ) -> Result<Option<Self>, Failure> {
        let configured = &configuration.odometry.wheels;
        let configured_file = configured.file.as_deref();
        let named = named.or(configured_file.filter(|_| configured.kind == WheelsKind::Log));
        let of = |log| Self {
            log,
            configured: configured.clone(),
            is_named: named.is_some(),
        };
        if let Some(file) = named {
            return Ok(Some(of(WheelLog::read(file, configured.m_per_tick)?)));
        }
        let Ok(file) = WheelLog::find(&configuration.source.data) else {
            return Ok(None);
        };
        match WheelLog::read(&file, configured.m_per_tick) {
            Ok(log) => Ok(Some(of(log))),
            Err(error) => {
                print::note(format_args!("the wheels are left alone: {error}"));
                Ok(None)
            }
        }
    }

    /// Finds the clock and the scale of the wheels by a drive, and prints them.
    fn calibrate(&self, drive: &Drive) -> Result<Result<WheelCalibration, ClockError>, Failure> {
        let track = drive.mean_track()?;
        let log = self.log.path.display();
        print::line(format_args!("{:<21} {log}", "wheels, log"))?;
        let max_gap_s = self.configured.max_gap_s;
        let found = calibrate_wheels(drive, &track, &self.log.samples, max_gap_s);
        match &found {
            Ok(found) => print::line(found.table(&self.configured))?,
            Err(error) => print::line(format_args!("{:<21} not told: {error}", ""))?,
        }
        Ok(found)
    }
}

/// Calibrates the wheels by the drives that have a log, and prints the findings.
pub(super) fn section(logs: &[(&Wheels, &Drive)]) -> Result<Section, Failure> {
    let Some((first, _)) = logs.first() else {
        return Ok(Section::default());
    };
    let (mut told, mut refused) = (Vec::new(), None);
    for (wheels, drive) in logs {
        match wheels.calibrate(drive)? {
            Ok(found) => told.push(found),
            Err(error) => refused = Some(error),
        }
    }
    let Some((one, others)) = told.split_first() else {
        return Ok(Section::refused("wheels are", refused, first.is_named));
    };
    let found = one.mean(others);
    if !others.is_empty() {
        let table = found.table(&first.configured);
        print::line(format_args!("wheels, all drives together\n{table}"))?;
    }
    // A relative path is one of the file's folder.
    let file = first.is_named.then(|| absolute(&first.log.path));
    let file = file.transpose()?;
    let m_per_tick = first.configured.m_per_tick;
    Ok(Section::told(found.toml(file.as_deref(), m_per_tick)))
}
