use bytemuck::{Pod, Zeroable};

use crate::{
    Twist,
    samples::{GyroConfig, SampleKind, integral::Integrator},
};

/// The turn of the sensor from one scan to the next by the gyro, counter-clockwise.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GyroTurn {
    /// From the stamp of the scan before to the stamp of the scan, rad, with the bias.
    pub yaw_rad: f64,
    /// Variance but for the bias and the scale, rad².
    pub variance_rad2: f64,
    pub interval_s: f64,
    /// Mean rate during the sweep of the scan, rad/s, with the bias.
    pub sweep_rate_radps: f64,
}

pub type Gyro = Integrator<GyroConfig>;

impl Gyro {
    pub fn new(config: &GyroConfig) -> Self {
        Self::of(config.clone(), SampleKind::Gyro, 2, config.max_gap_s)
    }

    /// Returns the turn from the stamp of the scan before to the stamp of the scan; `None` where
    /// samples are missing.
    pub fn turn(&self) -> Option<GyroTurn> {
        let integral = self.integral?;
        let [_, sweep] = self.means();
        let by_time = self.config.time_sigma_s * integral.change;
        let walk = self.config.noise_rad_per_sqrt_s.powi(2) * integral.interval_s;
        Some(GyroTurn {
            yaw_rad: integral.sum,
            variance_rad2: walk + by_time * by_time,
            interval_s: integral.interval_s,
            sweep_rate_radps: sweep?,
        })
    }

    /// Returns the mean rates during the sweeps of the scan before and of the scan, rad/s; `None`
    /// where samples are missing.
    pub fn sweep_rates_radps(&self) -> [Option<f64>; 2] {
        self.means()
    }
}

/// Returns the velocity for the compensation of a sweep: with the gyro's mean rate, if it has one.
pub fn with_yaw_rate(twist: Option<Twist>, rate_radps: Option<f64>) -> Option<Twist> {
    twist.map(|twist| Twist {
        yaw_rate_radps: rate_radps.unwrap_or(twist.yaw_rate_radps),
        ..twist
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::Sample;
    use proptest::prelude::*;

    /// A stamp, ms, and the yaw rate, rad/s.
    type Rate = (i64, f64);

    const MS: i64 = 1_000_000;
    const SWEEP: i64 = 250 * MS;

    /// The samples of sweep after sweep of 250 ms, each stamped in its middle.
    fn gyro(first_sweep: i64, scans: &[&[Rate]]) -> Gyro {
        let mut gyro = Gyro::new(&GyroConfig::default());
        for (k, rates) in (first_sweep..).zip(scans) {
            gyro.push(
                &samples(rates),
                k * SWEEP + SWEEP / 2,
                [k * SWEEP, (k + 1) * SWEEP],
            );
        }
        gyro
    }

    fn samples(rates: &[Rate]) -> Vec<Sample> {
        let sample = |(ms, rate): &Rate| Sample::yaw_rate(ms * MS, *rate);
        rates.iter().map(sample).collect()
    }

    /// Samples of a rate that grows evenly, from one time to another, ms.
    fn ramp(from: i64, to: i64, every: usize) -> Vec<Rate> {
        let stamps = (from..=to).step_by(every);
        stamps.map(|ms| (ms, 1e-3 * ms as f64)).collect()
    }

    proptest! {
        /// A rate that grows evenly is integrated exactly, whatever the stamps of the samples.
        #[test]
        fn the_turn_is_the_integral_of_the_rate(first in 0i64..100, every in 1usize..100) {
            let all = ramp(first, 501, every);
            let (before, after) = all.split_at(all.partition_point(|(ms, _)| *ms <= 250));
            let turn = gyro(0, &[before, after]).turn().unwrap_or_default();
            prop_assert!((turn.yaw_rad - 0.25 * 0.25).abs() < 1e-9, "{turn:?}");
            // At the ends of a sweep the nearest sample holds.
            let off = turn.sweep_rate_radps - 0.375;
            prop_assert!(off.abs() < 1e-3 * every as f64, "{turn:?}");
            prop_assert_eq!(turn.interval_s, 0.25);
        }
    }

    #[test]
    fn a_process_that_starts_at_the_scan_before_says_the_same() {
        let scans = [0, 250, 500].map(|from| ramp(from + 3, from + 250, 7));
        let whole = gyro(0, &[&scans[0], &scans[1], &scans[2]]);
        let late = gyro(1, &[&scans[1], &scans[2]]);
        assert!(whole.turn().is_some());
        assert_eq!(whole.turn(), late.turn());
        let alone = gyro(2, &[&scans[2]]);
        assert_eq!(alone.turn(), None);
        assert_eq!(whole.sweep_rates_radps()[1], alone.sweep_rates_radps()[1]);
    }

    #[test]
    fn nothing_is_made_up_where_samples_are_missing() {
        let all = ramp(0, 500, 10);
        let turn_without = |lost: std::ops::Range<i64>| {
            let kept = all.iter().filter(|(ms, _)| !lost.contains(ms));
            let (before, after): (Vec<_>, Vec<_>) = kept.partition(|(ms, _)| *ms <= 250);
            gyro(0, &[&before, &after]).turn()
        };
        assert!(turn_without(0..0).is_some() && turn_without(200..300).is_some());
        for lost in [200..330, 0..250, 370..501, 0..501] {
            assert_eq!(turn_without(lost.clone()), None, "{lost:?}");
        }
    }

    #[test]
    fn samples_of_a_dropped_scan_are_those_of_the_next_one() {
        let [first, second, third] = [0, 250, 500].map(|from| ramp(from + 1, from + 250, 10));
        let mut live = gyro(0, &[&first]);
        live.drop_scan(&samples(&second));
        live.push(&samples(&third), 625 * MS, [500 * MS, 750 * MS]);
        let turn = live.turn().unwrap_or_default();
        assert!((turn.yaw_rad - 0.5 * 0.375).abs() < 1e-3, "{turn:?}");
        let mut replayed = gyro(0, &[&first]);
        let both: Vec<Rate> = second.iter().chain(&third).copied().collect();
        replayed.push(&samples(&both), 625 * MS, [500 * MS, 750 * MS]);
        assert_eq!(Some(turn), replayed.turn());
        assert_eq!(live.sweep_rates_radps(), replayed.sweep_rates_radps());
    }
}
