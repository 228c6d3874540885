//! Samples of a log on the radar's clock.

use gyre_samples::{Sample, SampleKind};

use super::jumps;

/// Samples in the vehicle's axes on the radar's clock, in the order of their transport
/// ([`Sample::order`]).
#[derive(Clone, Debug, Default)]
pub struct SampleTrack(Vec<Sample>);

impl SampleTrack {
    pub(crate) fn of(samples: impl Iterator<Item = Sample>) -> Self {
        Self(samples.collect())
    }

    /// Leaves out samples of a kind, which all of its samples are of, that jump away from those
    /// around them faster than a vehicle can. Returns a sentence about jumps, if there are any.
    pub(crate) fn leave_out_jumps(&mut self, kind: SampleKind) -> Option<String> {
        jumps::leave_out(&mut self.0, kind).sentence()
    }

    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self.0.sort_by_key(Sample::order);
        self
    }

    /// Returns the track with each sample as `change` returns it, or without it. Of samples that
    /// have the same place in the order the first one stays.
    #[must_use]
    pub(crate) fn changed(self, change: impl FnMut(&Sample) -> Option<Sample>) -> Self {
        let mut changed: Vec<Sample> = self.0.iter().filter_map(change).collect();
        changed.sort_by_key(Sample::order);
        changed.dedup_by_key(|sample| sample.order());
        Self(changed)
    }

    /// Returns the samples with stamps after one time and up to another, which is included.
    pub fn between(&self, after_ns: i64, until_ns: i64) -> &[Sample] {
        let up_to = |ns| self.0.partition_point(|sample| sample.stamp_ns <= ns);
        let (from, to) = (up_to(after_ns), up_to(until_ns));
        self.0.get(from..to).unwrap_or_default()
    }

    pub fn span_ns(&self) -> Option<[i64; 2]> {
        Some([self.0.first()?.stamp_ns, self.0.last()?.stamp_ns])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::path::Path;

    use gyre_samples::{GyroConfig, UpAxis};
    use proptest::prelude::*;

    use super::*;
    use crate::GyroLog;

    use UpAxis::{MinusX, MinusY, MinusZ, X, Y, Z};
    const AXES: [UpAxis; 6] = [X, MinusX, Y, MinusY, Z, MinusZ];

    /// A track of samples of these stamps, in any order.
    fn of(mut stamps: Vec<i64>) -> SampleTrack {
        stamps.sort_unstable();
        let samples = stamps.iter().map(|ns| Sample::yaw_rate(*ns, 0.0));
        SampleTrack(samples.collect())
    }

    proptest! {
        /// Intervals that follow one another take every sample once, whatever their bounds.
        #[test]
        fn each_sample_is_of_one_interval(
            stamps in prop::collection::vec(0i64..1000, 0..50),
            mut bounds in prop::collection::vec(-10i64..1010, 2..20),
        ) {
            bounds.sort_unstable();
            let track = of(stamps.clone());
            let taken = bounds.windows(2).flat_map(|pair| track.between(pair[0], pair[1]));
            let taken: Vec<i64> = taken.map(|sample| sample.stamp_ns).collect();
            let within = |ns: &i64| bounds[0] < *ns && *ns <= *bounds.last().unwrap();
            let mut expected: Vec<i64> = stamps.into_iter().filter(within).collect();
            expected.sort_unstable();
            prop_assert_eq!(taken, expected);
        }
    }

    fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    }

    /// Whatever axis points up, the third rate is the rate about it, and the axes stay
    /// right-handed.
    #[test]
    fn the_axes_are_right_handed() {
        for up in AXES {
            let [x, y, z] =
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| up.in_vehicle(axis));
            assert_eq!(cross(x, y), z, "{up:?}");
            let axis = ["x", "y", "z"]
                .iter()
                .position(|axis| up.name().ends_with(axis));
            let about = [x, y, z][axis.unwrap()][2];
            assert_eq!(
                about,
                if up.name().starts_with('-') {
                    -1.0
                } else {
                    1.0
                }
            );
        }
    }

    #[test]
    fn delay_axis_and_scale_are_applied_and_the_bias_is_not() {
        let sample = Sample {
            values: [0.1, 0.2, -0.3, 1.0, 2.0, -9.8],
            ..Sample::yaw_rate(5_000_000_000, 0.0)
        };
        let log = GyroLog::of(vec![sample], Path::new("log")).unwrap();
        let config = GyroConfig {
            delay_s: 1.58,
            up: Some(MinusZ),
            scale: 1.01,
            bias_radps: 0.5,
            ..GyroConfig::default()
        };
        let track = SampleTrack::of(log.samples.iter().map(|it| config.on_radar(it)));
        assert_eq!(track.span_ns(), Some([3_420_000_000; 2]));
        let [sample] = track.between(0, 3_420_000_000) else {
            panic!("one sample");
        };
        assert_eq!(sample.values, [0.1, -0.2, 0.3 * 1.01, 1.0, -2.0, 9.8]);
    }

    #[test]
    fn changed_samples_are_in_order_and_no_two_have_one_stamp() {
        let late = |sample: &Sample| Sample {
            stamp_ns: sample.stamp_ns + if sample.stamp_ns < 3 { 2 } else { 0 },
            ..*sample
        };
        let kept = |sample: &Sample| (sample.stamp_ns != 5).then(|| late(sample));
        let changed = of(vec![1, 2, 3, 4, 5, 6]).changed(kept);
        let stamps: Vec<i64> = changed.0.iter().map(|it| it.stamp_ns).collect();
        assert_eq!(stamps, [3, 4, 6]);
    }

    #[test]
    fn a_reversed_interval_has_no_samples() {
        let track = of(vec![5]);
        assert!(track.between(7, 3).is_empty() && track.between(5, 5).is_empty());
        assert_eq!(track.between(4, 5).len(), 1);
        assert_eq!(SampleTrack::default().span_ns(), None);
    }
}
