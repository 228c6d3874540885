//! Samples of a live gyro or of live wheels, until the scan comes that they go with.

use crate::samples::{MAX_SAMPLES, Sample, SensorConfig, interval_of};

/// A sample that is so much later than the last scan, or before the first scan so far from the
/// newest sample, is of a clock that has jumped, ns.
const MAX_AHEAD_NS: i64 = 10_000_000_000;
/// Maximum number of samples that wait: ten seconds at 1600 Hz.
const MAX_WAITING: usize = 16 * MAX_SAMPLES;

/// Samples that have arrived, in the order of their stamps. Which of them go with a scan is decided
/// by their stamps; when they arrived decides only whether they are late.
pub struct LiveSamples {
    config: Box<dyn SensorConfig>,
    samples: Vec<Sample>,
    /// The end of the last scan, ns.
    handed_until_ns: Option<i64>,
    left_out: usize,
}

impl LiveSamples {
    /// Waits for samples that these settings take over to the radar's clock.
    pub fn new(config: Box<dyn SensorConfig>) -> Self {
        Self {
            config,
            samples: Vec::new(),
            handed_until_ns: None,
            left_out: 0,
        }
    }

    /// Takes a sample as its sensor sends it: in its own axes, on its own clock. One that cannot be
    /// used is left out, and counted: no number, a rate or a speed beyond any, a stamp that there
    /// was already, one of a scan that is gone, or one far ahead of the radar's.
    pub fn add(&mut self, sample: &Sample) {
        let sample = self.config.on_radar(sample, None);
        let place = self
            .samples
            .partition_point(|it| it.stamp_ns < sample.stamp_ns);
        let is_repeated = self
            .samples
            .get(place)
            .is_some_and(|it| it.stamp_ns == sample.stamp_ns);
        let newest_ns = self.samples.last().map(|it| it.stamp_ns);
        let after = |ns: i64| sample.stamp_ns.saturating_sub(ns);
        let is_of_now = match (self.handed_until_ns, newest_ns) {
            (Some(until_ns), _) => (1..=MAX_AHEAD_NS).contains(&after(until_ns)),
            (None, Some(newest_ns)) => after(newest_ns).saturating_abs() <= MAX_AHEAD_NS,
            (None, None) => true,
        };
        if is_repeated || !is_of_now || !sample.is_valid() {
            self.left_out += 1;
            return;
        }
        self.samples.insert(place, sample);
        if self.handed_until_ns.is_none() {
            // No scan needs such old samples.
            let oldest_ns = newest_ns.map_or(i64::MIN, |ns| ns.saturating_sub(MAX_AHEAD_NS));
            let old = self.samples.partition_point(|it| it.stamp_ns < oldest_ns);
            self.samples.drain(..old);
        }
        // The next scan needs the earliest, and the first one the latest.
        if self.samples.len() > MAX_WAITING {
            let surplus = match self.handed_until_ns {
                Some(_) => MAX_WAITING,
                None => 0,
            };
            self.samples.remove(surplus);
            self.left_out += 1;
        }
    }

    /// Returns the samples from the last one up to `ns` on.
    pub fn since(&self, ns: i64) -> &[Sample] {
        let after = self.samples.partition_point(|it| it.stamp_ns <= ns);
        &self.samples[after.saturating_sub(1)..]
    }

    /// Returns whether no sample of a scan that ends then can be missing, unless samples overtake
    /// each other.
    pub fn cover(&self, until_ns: i64) -> bool {
        let last = self.samples.last();
        last.is_some_and(|last| last.stamp_ns >= until_ns)
    }

    /// Returns the samples that come with a scan, from the times of its first and its last azimuth
    /// ([`interval_of`]), and the number of samples that were left out since the scan before.
    pub fn of_scan(&mut self, span_ns: [i64; 2]) -> (&[Sample], usize) {
        let [after_ns, until_ns] = interval_of(span_ns);
        let latest_ns = until_ns.saturating_add(MAX_AHEAD_NS);
        let ahead = self.samples.partition_point(|it| it.stamp_ns <= latest_ns);
        self.left_out += self.samples.drain(ahead..).count();
        self.samples.retain(|sample| sample.stamp_ns > after_ns);
        self.handed_until_ns = Some(until_ns);
        let end = self
            .samples
            .partition_point(|sample| sample.stamp_ns <= until_ns);
        let left_out = std::mem::take(&mut self.left_out);
        (&self.samples[..end], left_out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::{GyroConfig, UpAxis, WheelsConfig};
    use proptest::prelude::*;

    const MS: i64 = 1_000_000;

    fn of_gyro() -> LiveSamples {
        LiveSamples::new(Box::<GyroConfig>::default())
    }

    fn stamps(samples: &[Sample]) -> Vec<i64> {
        samples.iter().map(|it| it.stamp_ns / MS).collect()
    }

    proptest! {
        /// Whatever the order of arrival, each scan has the samples of its interval.
        #[test]
        fn stamps_alone_decide(order in Just((1..=50i64).collect::<Vec<_>>()).prop_shuffle()) {
            let mut live = of_gyro();
            order.iter().for_each(|ms| live.add(&Sample::yaw_rate(10 * ms * MS, 0.1)));
            for sweep in [[5 * MS, 255 * MS], [255 * MS, 505 * MS]] {
                let [after, until] = interval_of(sweep).map(|ns| ns / MS);
                let expected: Vec<i64> = (1..=50).map(|ms| 10 * ms).collect();
                let is_in = |ms: &i64| after < *ms && *ms <= until;
                let expected: Vec<i64> = expected.into_iter().filter(is_in).collect();
                let (samples, left_out) = live.of_scan(sweep);
                prop_assert_eq!((stamps(samples), left_out), (expected, 0));
            }
        }
    }

    #[test]
    fn what_cannot_be_used_is_left_out_and_counted() {
        let mut live = of_gyro();
        live.of_scan([0, 100 * MS]);
        for (stamp_ns, rate) in [
            (100 * MS, 0.1),    // of the scan that is gone
            (20_000 * MS, 0.1), // of a clock that has jumped
            (110 * MS, f64::NAN),
            (110 * MS, 57.0),
            (120 * MS, 0.1),
            (120 * MS, 0.2), // repeated
            (115 * MS, 0.1), // overtaken, and in time
        ] {
            live.add(&Sample::yaw_rate(stamp_ns, rate));
        }
        assert!(live.cover(120 * MS) && !live.cover(121 * MS));
        let (samples, left_out) = live.of_scan([100 * MS, 200 * MS]);
        assert_eq!((stamps(samples), left_out), (vec![115, 120], 5));
        assert_eq!(live.of_scan([500 * MS, 600 * MS]).1, 0);
    }

    #[test]
    fn samples_of_another_year_displace_none_and_all_are_counted() {
        const YEAR_NS: i64 = 365 * 86_400_000_000_000;
        // The clock that comes first counts until there is a scan.
        for (before, ahead, after, lost) in
            [(100, 2500, 100, 0), (0, 2500, 100, 100), (0, 0, 12_000, 0)]
        {
            let mut live = of_gyro();
            let mut add = |from_ns: i64, count: i64| {
                (1..=count).for_each(|k| live.add(&Sample::yaw_rate(from_ns + k * MS, 0.1)));
            };
            let end_ns = (before + after) * MS;
            add(0, before);
            add(YEAR_NS, ahead);
            add(before * MS, after);
            let sweep = [end_ns - 100 * MS, end_ns];
            let (samples, left_out) = live.of_scan(sweep);
            let of_scan = (end_ns - interval_of(sweep)[0]) / MS;
            let expected = (before + after).min(of_scan) - lost;
            assert_eq!(
                (samples.len() as i64, left_out as i64),
                (expected, ahead + lost)
            );
        }
        let mut flooded = of_gyro();
        (1..=20_000).for_each(|k| flooded.add(&Sample::yaw_rate(k, 0.1)));
        let (samples, left_out) = flooded.of_scan([0, MS]);
        assert_eq!(
            (samples.len(), left_out),
            (MAX_WAITING, 20_000 - MAX_WAITING)
        );
    }

    #[test]
    fn samples_are_put_on_the_radars_clock_and_axes_and_scaled() {
        let mut gyro = LiveSamples::new(Box::new(GyroConfig {
            delay_s: 0.1,
            up: Some(UpAxis::MinusZ),
            ..GyroConfig::default()
        }));
        let mut wheels = LiveSamples::new(Box::new(WheelsConfig {
            delay_s: 0.1,
            scale: 1.02,
            ..WheelsConfig::default()
        }));
        gyro.add(&Sample::yaw_rate(200 * MS, -0.5));
        for speed in [10.0, f64::INFINITY, 1e3] {
            wheels.add(&Sample::speed(200 * MS, speed));
        }
        for (mut live, expected, lost) in [
            (gyro, Sample::yaw_rate(100 * MS, 0.5), 0),
            (wheels, Sample::speed(100 * MS, 10.2), 2),
        ] {
            let (samples, left_out) = live.of_scan([0, 100 * MS]);
            assert_eq!((samples, left_out), (&[expected][..], lost));
        }
    }
}
