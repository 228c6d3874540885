//! The samples of other sensors that go with each scan of a dataset.

use std::path::Path;

use gyre_samples::{GyroConfig, GyroKind, Sample, interval_of};

use crate::{
    dataset::{Dataset, Format},
    gyro_log::{GyroLog, LogError, SampleTrack},
};

/// The samples of other sensors that come with the scans of a dataset: by their stamps alone.
#[derive(Debug)]
pub enum ScanSamples {
    /// There are none.
    None,
    /// From a log.
    Log(SampleTrack),
    /// With the scans of the recording of a run, whatever their stamps.
    Recorded,
}

impl ScanSamples {
    /// Opens what the section `[gyro]` names for the dataset in this folder, or for this bag.
    ///
    /// # Errors
    /// No log beside the scans, or one that cannot be read.
    pub fn open(
        config: &GyroConfig,
        folder: &Path,
        dataset: &mut dyn Dataset,
    ) -> Result<Self, LogError> {
        let log = match (config.kind, dataset.format()) {
            (GyroKind::None, _) => return Ok(Self::None),
            (_, Format::Mcap) => return Ok(Self::Recorded),
            (GyroKind::Auto, _) => match dataset.gyro(config.topic.as_deref())? {
                Some(samples) => GyroLog::of(samples, folder)?,
                None => GyroLog::read(&GyroLog::find(folder)?)?,
            },
            (GyroKind::Udp | GyroKind::Ros2, _) => return Err(LogError::Live),
            (GyroKind::Log, _) => GyroLog::read(&config.file.clone().unwrap_or_default())?,
        };
        Self::of_log(&log, config, dataset)
    }

    /// Takes the samples of a log.
    ///
    /// # Errors
    /// It has none from the first scan to the last.
    pub fn of_log(
        log: &GyroLog,
        config: &GyroConfig,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let track = SampleTrack::new(log, config);
        let last = dataset.len().saturating_sub(1);
        let [first_ns, last_ns] =
            [dataset.first(), last].map(|index| dataset.nominal_stamp_ns(index));
        if let (Some(first_ns), Some(last_ns), Some(span_ns)) = (first_ns, last_ns, track.span_ns())
            && track.between(first_ns, last_ns).is_empty()
        {
            return Err(LogError::Elsewhere {
                path: log.path.clone(),
                after_s: (span_ns[0] - first_ns) as f64 * 1e-9,
            });
        }
        Ok(Self::Log(track))
    }

    /// Returns the samples that come with the scan that was read last, in the order of their
    /// stamps, from the times of its first and its last azimuth: [`interval_of`].
    pub fn of<'a>(&'a self, dataset: &'a dyn Dataset, span_ns: [i64; 2]) -> &'a [Sample] {
        match self {
            Self::None => &[],
            Self::Recorded => dataset.samples(),
            Self::Log(track) => {
                let [after_ns, until_ns] = interval_of(span_ns);
                track.between(after_ns, until_ns)
            }
        }
    }
}
