//! The samples of other sensors that go with each scan of a dataset.

use std::{borrow::Cow, path::Path};

use gyre_geometry::samples::{Sample, SampleKind, SensorConfig, SensorKind, interval_of};

use crate::{
    LogError, SampleLog,
    dataset::{Dataset, Format},
    sample_log::jumps,
};

/// The samples of other sensors that come with the scans of a dataset: by their stamps alone.
#[derive(Debug)]
pub enum ScanSamples {
    None,
    /// Samples in the vehicle's axes on the radar's clock, in the order of [`Sample::order`].
    Log {
        samples: Vec<Sample>,
        faults: Vec<String>,
    },
    Recorded(Vec<SampleKind>),
}

impl ScanSamples {
    /// Opens the logs that the sections of these sensors name, for the dataset in this folder, or
    /// for this bag.
    pub fn open(
        sensors: &[&dyn SensorConfig],
        folder: &Path,
        dataset: &mut dyn Dataset,
    ) -> Result<Self, LogError> {
        if dataset.format() == Format::Mcap {
            let used = sensors.iter().filter(|sensor| sensor.kind().is_used());
            let used: Vec<SampleKind> = used.map(|sensor| sensor.of()).collect();
            return Ok(match used.is_empty() {
                true => Self::None,
                false => Self::Recorded(used),
            });
        }
        sensors.iter().try_fold(Self::None, |all, sensor| {
            Ok(match log(*sensor, folder, dataset)? {
                Some(log) => all.and(Self::of_log(&log, *sensor, dataset)?),
                None => all,
            })
        })
    }

    /// Takes the samples of a log over to the radar's clock and the vehicle's axes.
    pub fn of_log(
        log: &SampleLog,
        sensor: &dyn SensorConfig,
        dataset: &dyn Dataset,
    ) -> Result<Self, LogError> {
        let up = match log.of {
            SampleKind::Gyro => Some(log.up(sensor.up(), dataset.format())?),
            _ => None,
        };
        let samples = log.samples.iter().map(|it| sensor.on_radar(it, up));
        let mut samples: Vec<Sample> = samples.collect();
        let last = dataset.len().saturating_sub(1);
        let [first_ns, last_ns] =
            [dataset.first(), last].map(|index| dataset.nominal_stamp_ns(index));
        if let (Some(first_ns), Some(last_ns), Some(begin)) = (first_ns, last_ns, samples.first())
            && between(&samples, first_ns, last_ns).is_empty()
        {
            let (of, path, faults) = (log.of.section(), log.path.display(), &log.faults);
            let after_s = (begin.stamp_ns - first_ns) as f64 * 1e-9;
            let steps = match faults.clock_steps_s.is_empty() {
                true => String::new(),
                false => format!("{}. ", faults.clock_steps()),
            };
            return Err(LogError::Unusable(format!(
                "the log of the {of} {path} has no sample while the scans were measured: it begins {after_s:.1} s after the first of them. {steps}It is of a different drive, or {of}.delay_s is wrong"
            )));
        }
        let named = |sentence| format!("{}: {sentence}", log.path.display());
        let jumps = jumps::leave_out(&mut samples, log.of).sentence();
        let faults = log.sentences().into_iter().chain(jumps);
        let faults = faults.map(named).collect();
        Ok(Self::Log { samples, faults })
    }

    #[must_use]
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (
                Self::Log {
                    mut samples,
                    mut faults,
                },
                Self::Log {
                    samples: others,
                    faults: more,
                },
            ) => {
                samples.extend(others);
                samples.sort_by_key(Sample::order);
                faults.extend(more);
                Self::Log { samples, faults }
            }
            (Self::None, other) => other,
            (one, _) => one,
        }
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
            Self::Log { samples, .. } => {
                let [after_ns, until_ns] = interval_of(span_ns);
                Cow::Borrowed(between(samples, after_ns, until_ns))
            }
        }
    }
}

/// Reads the log that the section of a sensor names; `None` if the sensor is not used.
fn log(
    sensor: &dyn SensorConfig,
    folder: &Path,
    dataset: &mut dyn Dataset,
) -> Result<Option<SampleLog>, LogError> {
    let of = sensor.of();
    let read = |file: &Path| SampleLog::read(of, file, sensor.m_per_tick()).map(Some);
    match sensor.kind() {
        SensorKind::None => Ok(None),
        SensorKind::Udp | SensorKind::Ros2 => Err(LogError::Live { of }),
        SensorKind::Log => read(sensor.file()),
        SensorKind::Auto => match dataset.logged(of, sensor.topic())? {
            Some(logged) => SampleLog::of(of, logged, folder).map(Some),
            None => read(&SampleLog::find(of, folder)?),
        },
    }
}

/// Returns the samples with stamps after one time and up to another, which is included.
fn between(samples: &[Sample], after_ns: i64, until_ns: i64) -> &[Sample] {
    let up_to = |ns| samples.partition_point(|sample| sample.stamp_ns <= ns);
    samples
        .get(up_to(after_ns)..up_to(until_ns))
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use gyre_geometry::samples::GyroConfig;
    use gyre_geometry::samples::UpAxis::{MinusX, MinusY, MinusZ, X, Y, Z};
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    /// Samples of these stamps, in any order.
    fn of(mut stamps: Vec<i64>) -> Vec<Sample> {
        stamps.sort_unstable();
        let samples = stamps.iter().map(|ns| Sample::yaw_rate(*ns, 0.0));
        samples.collect()
    }

    proptest! {
        /// Intervals that follow one another take every sample once, whatever their bounds.
        #[test]
        fn each_sample_is_of_one_interval(
            stamps in prop::collection::vec(0i64..1000, 0..50),
            mut bounds in prop::collection::vec(-10i64..1010, 2..20),
        ) {
            bounds.sort_unstable();
            let samples = of(stamps.clone());
            let taken = bounds.windows(2).flat_map(|pair| between(&samples, pair[0], pair[1]));
            let taken: Vec<i64> = taken.map(|sample| sample.stamp_ns).collect();
            let within = |ns: &i64| bounds[0] < *ns && *ns <= *bounds.last().unwrap();
            let mut expected: Vec<i64> = stamps.into_iter().filter(within).collect();
            expected.sort_unstable();
            prop_assert_eq!(taken, expected);
        }
    }

    /// Whatever axis points up, the third rate is the rate about it, and the axes stay
    /// right-handed.
    #[test]
    fn the_axes_are_right_handed() {
        for (up, [axis, sign]) in [
            (X, [0, 1]),
            (MinusX, [0, -1]),
            (Y, [1, 1]),
            (MinusY, [1, -1]),
            (Z, [2, 1]),
            (MinusZ, [2, -1]),
        ] {
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let [x, y, z] = axes.map(|axis| Vector3::from(up.in_vehicle(axis.into())));
            assert_eq!(x.cross(&y), z, "{up:?}");
            assert_eq!([x, y, z][axis as usize].z, f64::from(sign), "{up:?}");
        }
    }

    #[test]
    fn delay_axis_and_scale_are_applied_and_the_bias_is_not() {
        let sample = Sample {
            values: [0.1, 0.2, -0.3, 1.0, 2.0, -9.8],
            ..Sample::yaw_rate(5_000_000_000, 0.0)
        };
        let config = GyroConfig {
            delay_s: 1.58,
            up: Some(MinusZ),
            scale: 1.01,
            bias_radps: 0.5,
            ..GyroConfig::default()
        };
        let sample = config.on_radar(&sample, None);
        assert_eq!(sample.stamp_ns, 3_420_000_000);
        assert_eq!(sample.values, [0.1, -0.2, 0.3 * 1.01, 1.0, -2.0, 9.8]);
    }

    #[test]
    fn a_reversed_interval_has_no_samples() {
        let samples = of(vec![5]);
        assert!(between(&samples, 7, 3).is_empty() && between(&samples, 5, 5).is_empty());
        assert_eq!(between(&samples, 4, 5).len(), 1);
    }
}
