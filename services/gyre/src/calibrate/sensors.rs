//! The sensors beside the scans of a drive: their logs, and the radar's findings about them.

use std::path::{PathBuf, absolute};

use gyre_calibration::{Kind, SensorSettings, calibrate_sensor, kinds};
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_datasets::SampleLog;
use gyre_geometry::samples::{SensorConfigs, SensorKind};

use super::{CalibrateArguments, Recorded};

/// A kind of sensor: where its settings are.
struct Row {
    kind: &'static Kind,
    named: fn(&CalibrateArguments) -> Option<&PathBuf>,
    settings: fn(&SensorConfigs) -> SensorSettings,
}

const ROWS: [Row; 2] = [
    Row {
        kind: &kinds::GYRO,
        named: |arguments| arguments.gyro.as_ref(),
        settings: |SensorConfigs { gyro, .. }| SensorSettings {
            is_used: gyro.is_used(),
            file: gyro.file.clone().filter(|_| gyro.kind == SensorKind::Log),
            up: gyro.up,
            m_per_tick: None,
            delay_s: gyro.delay_s,
            scale: gyro.scale,
            max_gap_s: gyro.max_gap_s,
        },
    },
    Row {
        kind: &kinds::WHEELS,
        named: |arguments| arguments.wheels.as_ref(),
        settings: |SensorConfigs { wheels, .. }| SensorSettings {
            is_used: wheels.is_used(),
            file: wheels
                .file
                .clone()
                .filter(|_| wheels.kind == SensorKind::Log),
            up: None,
            m_per_tick: wheels.m_per_tick,
            delay_s: wheels.delay_s,
            scale: wheels.scale,
            max_gap_s: wheels.max_gap_s,
        },
    },
];

/// Leaves the radar alone: the other sensors are compared with it.
pub(super) fn leave_out(config: &mut SensorConfigs) {
    let doppler = config.doppler.clone();
    *config = SensorConfigs {
        doppler,
        ..SensorConfigs::default()
    };
}

/// The log of a sensor in a drive.
pub(crate) struct Sensor {
    pub(crate) kind: &'static Kind,
    pub(crate) log: SampleLog,
    pub(crate) configured: SensorSettings,
    /// It was named, rather than found beside the scans.
    is_named: bool,
}

/// The part of the file that is of the sensors beside the radar.
#[derive(Default)]
pub(super) struct Section {
    pub(super) text: String,
    pub(super) is_told: bool,
    /// Why the sensor of a log that was named is not calibrated.
    pub(super) refused: Option<Failure>,
}

impl Sensor {
    /// Reads the logs of a drive, in the order of the kinds.
    pub(super) fn read_all(
        configuration: &Configuration,
        arguments: &CalibrateArguments,
    ) -> Result<Vec<Option<Self>>, Failure> {
        let read = |row| Self::read(row, configuration, arguments);
        ROWS.iter().map(read).collect()
    }

    /// A log that lies beside the scans and cannot be used is named, and left alone.
    fn read(
        row: &Row,
        configuration: &Configuration,
        arguments: &CalibrateArguments,
    ) -> Result<Option<Self>, Failure> {
        let configured = (row.settings)(&configuration.odometry.sensors);
        let named = (row.named)(arguments).or(configured.file.as_ref()).cloned();
        let is_named = named.is_some();
        let of = row.kind.sensor;
        let beside = || SampleLog::find(of, &configuration.source.data).ok();
        let Some(file) = named.or_else(beside) else {
            return Ok(None);
        };
        match SampleLog::read(of, &file, configured.m_per_tick) {
            Ok(log) => Ok(Some(Self {
                kind: row.kind,
                log,
                configured,
                is_named,
            })),
            Err(error) if is_named => Err(error.into()),
            Err(error) => {
                let subject = row.kind.subject;
                print::note(format_args!("the {subject} left alone: {error}"));
                Ok(None)
            }
        }
    }
}

impl Section {
    /// Calibrates the sensors of all drives, kind by kind.
    pub(super) fn of(drives: &[Recorded]) -> Result<Self, Failure> {
        let mut section = Self::default();
        for kind in 0..ROWS.len() {
            let logs = drives.iter();
            let logs = logs.filter_map(|it| Some((it.sensors[kind].as_ref()?, it)));
            section.add(&logs.collect::<Vec<_>>())?;
        }
        Ok(section)
    }

    /// Calibrates a sensor by the tracks of drives.
    fn add(&mut self, logs: &[(&Sensor, &Recorded)]) -> Result<(), Failure> {
        let (mut told, mut refused) = (Vec::new(), None);
        for (sensor, recorded) in logs {
            let (drive, track) = (&recorded.drive, &recorded.track);
            let title = format!("{}, log", sensor.kind.sensor.section());
            let (log, max_gap_s) = (&sensor.log, sensor.configured.max_gap_s);
            print::line(format_args!("{title:<21} {}", log.path.display()))?;
            match calibrate_sensor(sensor.kind, drive, track, &log.samples, max_gap_s) {
                Ok(found) => {
                    print::line(found.table(&sensor.configured))?;
                    told.push(found);
                }
                Err(error) => {
                    print::line(format_args!("{:<21} not determined: {error}", ""))?;
                    refused = Some((sensor, error));
                }
            }
        }
        let (Some((one, others)), Some((first, _))) = (told.split_first(), logs.first()) else {
            if let Some((sensor, error)) = refused {
                let is = sensor.kind.subject;
                self.text += &format!("\n# The {is} not calibrated: {error}\n");
                if sensor.is_named && self.refused.is_none() {
                    self.refused = Some(error.into());
                }
            }
            return Ok(());
        };
        let found = one.mean(others)?;
        if !others.is_empty() {
            let (section, table) = (first.kind.sensor.section(), found.table(&first.configured));
            print::line(format_args!("{section}, all drives together\n{table}"))?;
        }
        // A relative path is one of the file's folder.
        let file = first.is_named.then(|| absolute(&first.log.path));
        let file = file.transpose()?;
        self.text += &found.toml(file.as_deref(), first.configured.m_per_tick);
        self.is_told = true;
        Ok(())
    }
}
