//! The samples of other sensors that go with each scan of a dataset.

use std::{borrow::Cow, path::Path};

use gyre_samples::{
    GyroConfig, GyroKind, Sample, SampleKind, WheelsConfig, WheelsKind, interval_of,
};

use crate::{
    LogError, WheelLog,
    dataset::{Dataset, Format},
    gyro_log::{GyroLog, LogFaults, SampleTrack},
};

/// The samples of other sensors that come with the scans of a dataset: by their stamps alone.
#[derive(Debug)]
pub enum ScanSamples {
    /// There are none.
    None,
    /// From logs.
    Log {
        track: SampleTrack,
        /// A sentence for each kind of fault in a log, with its path.
        faults: Vec<String>,
    },
    /// Recorded with the scans of a run, whatever their stamps: the samples of these kinds.
    Recorded(Vec<SampleKind>),
}

impl ScanSamples {
    /// Opens the logs in the sections `[gyro]` and `[wheels]` for the dataset in this folder, or
    /// for this bag.
    pub fn open(
        gyro: &GyroConfig,
        wheels: &WheelsConfig,
        folder: &Path,
        dataset: &mut dyn Dataset,
    ) -> Result<Self, LogError> {
        if dataset.format() == Format::Mcap {
            return Ok(Self::recorded(gyro, wheels));
        }
        let turns = match gyro.kind {
            GyroKind::None => None,
            GyroKind::Auto => {
                let own = dataset.logged(SampleKind::Gyro, gyro.topic.as_deref())?;
                Some(match own {
                    Some(samples) => GyroLog::of(samples, folder)?,
                    None => GyroLog::read(&GyroLog::find(folder)?)?,
                })
            }
            GyroKind::Udp | GyroKind::Ros2 => {
                return Err(LogError::Live {
                    of: SampleKind::Gyro.section(),
                });
            }
            GyroKind::Log => Some(GyroLog::read(&gyro.file.clone().unwrap_or_default())?),
        };
        let speeds = match wheels.kind {
            WheelsKind::None => None,
            WheelsKind::Auto => {
                let own = dataset.logged(SampleKind::Wheels, wheels.topic.as_deref())?;
                Some(match own {
                    Some(samples) => WheelLog::of(samples, folder)?,
                    None => WheelLog::read(&WheelLog::find(folder)?, wheels.m_per_tick)?,
                })
            }
            WheelsKind::Udp | WheelsKind::Ros2 => {
                return Err(LogError::Live {
                    of: SampleKind::Wheels.section(),
                });
            }
            WheelsKind::Log => {
                let file = wheels.file.clone().unwrap_or_default();
                Some(WheelLog::read(&file, wheels.m_per_tick)?)
            }
        };
        let of_gyro = turns.map(|log| Self::of_gyro(&log, gyro, dataset));
        let of_wheels = speeds.map(|log| Self::of_wheels(&log, wheels, dataset));
        let none = || Ok(Self::None);
        Ok(of_gyro
            .unwrap_or_else(none)?
            .and(of_wheels.unwrap_or_else(none)?))
    }

    /// Takes the samples of the log of a gyro.
    pub fn of_gyro(
        log: &GyroLog,
        config: &GyroConfig,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let config = GyroConfig {
            up: Some(log.up(config.up, dataset.format())?),
            ..config.clone()
        };
        let track = SampleTrack::new(log, &config);
        Self::of_track(track, (SampleKind::Gyro, &log.path), &log.faults, dataset)
    }

    /// Takes the samples of the log of the wheels.
    pub fn of_wheels(
        log: &WheelLog,
        config: &WheelsConfig,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let track = log.track(config);
        Self::of_track(track, (SampleKind::Wheels, &log.path), &log.faults, dataset)
    }

    /// Joins the samples of two logs.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (
                Self::Log { track, mut faults },
                Self::Log {
                    track: other,
                    faults: more,
                },
            ) => {
                faults.extend(more);
                let track = track.and(other);
                Self::Log { track, faults }
            }
            (Self::None, other) => other,
            (one, _) => one,
        }
    }

    /// Returns the same with each sample of a log as `change` returns it, or without it.
    #[must_use]
    pub fn changed(self, change: impl FnMut(&Sample) -> Option<Sample>) -> Self {
        match self {
            Self::Log { track, faults } => Self::Log {
                track: track.changed(change),
                faults,
            },
            other => other,
        }
    }

    /// The samples that a recording has, of the kinds that are used.
    fn recorded(gyro: &GyroConfig, wheels: &WheelsConfig) -> Self {
        let used = [
            gyro.is_used().then_some(SampleKind::Gyro),
            wheels.is_used().then_some(SampleKind::Wheels),
        ];
        match used.iter().flatten().count() {
            0 => Self::None,
            _ => Self::Recorded(used.into_iter().flatten().collect()),
        }
    }

    fn of_track(
        mut track: SampleTrack,
        (of, path): (SampleKind, &Path),
        faults: &LogFaults,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let last = dataset.len().saturating_sub(1);
        let [first_ns, last_ns] =
            [dataset.first(), last].map(|index| dataset.nominal_stamp_ns(index));
        if let (Some(first_ns), Some(last_ns), Some(span_ns)) = (first_ns, last_ns, track.span_ns())
            && track.between(first_ns, last_ns).is_empty()
        {
            return Err(LogError::Elsewhere {
                of: of.section(),
                path: path.to_owned(),
                after_s: (span_ns[0] - first_ns) as f64 * 1e-9,
                steps: match faults.clock_steps_s.is_empty() {
                    true => String::new(),
                    false => format!("{}. ", faults.clock_steps()),
                },
            });
        }
        let named = |sentence| format!("{}: {sentence}", path.display());
        let jumps = track.leave_out_jumps(of);
        let faults = faults.sentences(of).into_iter().chain(jumps);
        let faults = faults.map(named).collect();
        Ok(Self::Log { track, faults })
    }

    /// Returns a sentence for each kind of fault in the logs, as of samples that are left out.
    pub fn faults(&self) -> &[String] {
        match self {
            Self::Log { faults, .. } => faults,
            _ => &[],
        }
    }

    /// Returns the samples that come with the scan that was read last, in the order of
    /// [`Sample::order`], from the times of its first and its last azimuth: [`interval_of`].
    pub fn of<'a>(&'a self, dataset: &'a dyn Dataset, span_ns: [i64; 2]) -> Cow<'a, [Sample]> {
        match self {
            Self::None => Cow::Borrowed(&[]),
            Self::Recorded(kinds) => {
                let is_used = |sample: &Sample| kinds.iter().any(|kind| sample.is(*kind));
                match dataset.samples() {
                    samples if samples.iter().all(is_used) => Cow::Borrowed(samples),
                    samples => samples.iter().copied().filter(is_used).collect(),
                }
            }
            Self::Log { track, .. } => {
                let [after_ns, until_ns] = interval_of(span_ns);
                Cow::Borrowed(track.between(after_ns, until_ns))
            }
        }
    }
}
