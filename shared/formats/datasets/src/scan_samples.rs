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
    None,
    Log {
        track: SampleTrack,
        faults: Vec<String>,
    },
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
        let live = |of: SampleKind| Err(LogError::Live { of: of.section() });
        let turns = match gyro.kind {
            GyroKind::None => None,
            GyroKind::Udp | GyroKind::Ros2 => return live(SampleKind::Gyro),
            GyroKind::Log => Some(GyroLog::read(&gyro.file.clone().unwrap_or_default())?),
            GyroKind::Auto => Some(
                match dataset.logged(SampleKind::Gyro, gyro.topic.as_deref())? {
                    Some(samples) => GyroLog::of(samples, folder)?,
                    None => GyroLog::read(&GyroLog::find(folder)?)?,
                },
            ),
        };
        let read = |file: &Path| WheelLog::read(file, wheels.m_per_tick);
        let speeds = match wheels.kind {
            WheelsKind::None => None,
            WheelsKind::Udp | WheelsKind::Ros2 => return live(SampleKind::Wheels),
            WheelsKind::Log => Some(read(&wheels.file.clone().unwrap_or_default())?),
            WheelsKind::Auto => Some(
                match dataset.logged(SampleKind::Wheels, wheels.topic.as_deref())? {
                    Some(samples) => WheelLog::of(samples, folder)?,
                    None => read(&WheelLog::find(folder)?)?,
                },
            ),
        };
        let mut all = Self::None;
        if let Some(log) = turns {
            all = Self::of_gyro(&log, gyro, dataset)?;
        }
        if let Some(log) = speeds {
            all = all.and(Self::of_wheels(&log, wheels, dataset)?);
        }
        Ok(all)
    }

    pub fn of_gyro(
        log: &GyroLog,
        config: &GyroConfig,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let config = GyroConfig {
            up: Some(log.up(config.up, dataset.format())?),
            ..config.clone()
        };
        let track = SampleTrack::of(log.samples.iter().map(|it| config.on_radar(it)));
        Self::of_track(track, (SampleKind::Gyro, &log.path), &log.faults, dataset)
    }

    pub fn of_wheels(
        log: &WheelLog,
        config: &WheelsConfig,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let track = SampleTrack::of(log.samples.iter().map(|it| config.on_radar(it)));
        Self::of_track(track, (SampleKind::Wheels, &log.path), &log.faults, dataset)
    }

    #[must_use]
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (
                Self::Log { track, faults },
                Self::Log {
                    track: other,
                    faults: more,
                },
            ) => {
                let (track, faults) = (track.and(other), [faults, more].concat());
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

    fn recorded(gyro: &GyroConfig, wheels: &WheelsConfig) -> Self {
        let gyro = gyro.is_used().then_some(SampleKind::Gyro);
        let wheels = wheels.is_used().then_some(SampleKind::Wheels);
        let used: Vec<SampleKind> = gyro.into_iter().chain(wheels).collect();
        match used.is_empty() {
            true => Self::None,
            false => Self::Recorded(used),
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
            let (of, path) = (of.section(), path.display());
            let after_s = (span_ns[0] - first_ns) as f64 * 1e-9;
            let steps = match faults.clock_steps_s.is_empty() {
                true => String::new(),
                false => format!("{}. ", faults.clock_steps()),
            };
            return Err(LogError::Unusable(format!(
                "the log of the {of} {path} has no sample while the scans were measured: it begins {after_s:.1} s after the first of them. {steps}It is of a different drive, or {of}.delay_s is wrong"
            )));
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
