//! The gyro and the wheels beside the scans of a drive: their logs, and the radar's findings about
//! them.

use std::path::{Path, absolute};

use gyre_calibration::{
    ClockError, Drive, GyroCalibration, WheelCalibration, calibrate_gyro, calibrate_wheels,
};
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_datasets::SampleLog;
use gyre_geometry::samples::{GyroConfig, GyroKind, SampleKind, WheelsConfig};

use super::Section;

macro_rules! sensor {
    (
        $sensor:ident: $title:literal, $is:literal, $section:ident, $calibrate:ident,
        $log:ty, $config:ty, $found:ty,
        beside: $beside:expr, read: $read:expr, mean: $mean:expr, toml: $toml:expr
    ) => {
        pub(super) struct $sensor {
            log: $log,
            configured: $config,
            /// It was named, rather than found beside the scans.
            is_named: bool,
        }

        impl $sensor {
            /// A log that lies beside the scans and cannot be used is named, and left alone.
            pub(super) fn read(
                configuration: &Configuration,
                named: Option<&Path>,
            ) -> Result<Option<Self>, Failure> {
                let configured = &configuration.odometry.$section;
                let configured_file = configured.file.as_deref();
                let named = named.or(configured_file.filter(|_| configured.kind == GyroKind::Log));
                let file = named.map(Path::to_owned);
                let (beside, read) = ($beside, $read);
                let Some(file) = file.or_else(|| beside(&configuration.source.data)) else {
                    return Ok(None);
                };
                match read(&file, configured) {
                    Ok(log) => Ok(Some(Self {
                        log,
                        configured: configured.clone(),
                        is_named: named.is_some(),
                    })),
                    Err(error) if named.is_some() => Err(error.into()),
                    Err(error) => {
                        print::note(format_args!("the {} left alone: {error}", $is));
                        Ok(None)
                    }
                }
            }

            fn calibrate(&self, drive: &Drive) -> Result<Result<$found, ClockError>, Failure> {
                let track = drive.mean_track()?;
                let log = self.log.path.display();
                print::line(format_args!("{:<21} {log}", $title))?;
                let max_gap_s = self.configured.max_gap_s;
                let found = $calibrate(drive, &track, &self.log.samples, max_gap_s);
                match &found {
                    Ok(found) => print::line(found.table(&self.configured))?,
                    Err(error) => print::line(format_args!("{:<21} not determined: {error}", ""))?,
                }
                Ok(found)
            }

            pub(super) fn section(logs: &[(&Self, &Drive)]) -> Result<Section, Failure> {
                let Some((first, _)) = logs.first() else {
                    return Ok(Section::default());
                };
                let (mut told, mut refused) = (Vec::new(), None);
                for (sensor, drive) in logs {
                    match sensor.calibrate(drive)? {
                        Ok(found) => told.push(found),
                        Err(error) => refused = Some(error),
                    }
                }
                let Some((one, others)) = told.split_first() else {
                    let reason = refused.as_ref();
                    let text = reason.map(|it| format!("\n# The {} not calibrated: {it}\n", $is));
                    return Ok(Section {
                        text: text.unwrap_or_default(),
                        is_told: false,
                        refused: refused.filter(|_| first.is_named).map(Into::into),
                    });
                };
                let (mean, toml) = ($mean, $toml);
                let found: $found = mean(one, others)?;
                if !others.is_empty() {
                    let (sensor, table) = (stringify!($section), found.table(&first.configured));
                    print::line(format_args!("{sensor}, all drives together\n{table}"))?;
                }
                // A relative path is one of the file's folder.
                let file = first.is_named.then(|| absolute(&first.log.path));
                let file = file.transpose()?;
                Ok(Section {
                    text: toml(&found, file.as_deref(), &first.configured),
                    is_told: true,
                    refused: None,
                })
            }
        }
    };
}

sensor! {
    Gyro: "gyro, log", "gyro is", gyro, calibrate_gyro,
    SampleLog, GyroConfig, GyroCalibration,
    beside: |folder: &Path| SampleLog::find(SampleKind::Gyro, folder).ok(),
    read: |file: &Path, _: &GyroConfig| SampleLog::read(SampleKind::Gyro, file, None),
    mean: GyroCalibration::mean,
    toml: |found: &GyroCalibration, file: Option<&Path>, _: &GyroConfig| found.toml(file)
}

sensor! {
    Wheels: "wheels, log", "wheels are", wheels, calibrate_wheels,
    SampleLog, WheelsConfig, WheelCalibration,
    beside: |folder: &Path| SampleLog::find(SampleKind::Wheels, folder).ok(),
    read: |file: &Path, config: &WheelsConfig| SampleLog::read(SampleKind::Wheels, file, config.m_per_tick),
    mean: |one: &WheelCalibration, others: &[WheelCalibration]| -> Result<_, Failure> {
        Ok(one.mean(others))
    },
    toml: |found: &WheelCalibration, file: Option<&Path>, config: &WheelsConfig| {
        found.toml(file, config.m_per_tick)
    }
}
