use bytemuck::{Pod, Zeroable};

use crate::samples::{SampleKind, WheelsConfig, integral::Integrator};

/// Standard deviation of a speed by the rounding to a step, m/s.
const NOISE_MPS: f64 = 0.02;

/// The distance from one scan to the next by the wheels, along the vehicle's path.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct WheelDistance {
    /// From the stamp of the scan before to the stamp of the scan, m; negative backwards.
    pub distance_m: f64,
    /// Variance but for the scale, m².
    pub variance_m2: f64,
    pub side_variance_m2: f64,
    pub interval_s: f64,
}

pub type Wheels = Integrator<WheelsConfig>;

impl Wheels {
    pub fn new(config: &WheelsConfig) -> Self {
        Self::of(config.clone(), SampleKind::Wheels, 0, config.max_gap_s)
    }

    /// Returns the distance from the stamp of the scan before to the stamp of the scan; `None`
    /// where samples are missing.
    pub fn distance(&self) -> Option<WheelDistance> {
        let integral = self.integral?;
        let of_rolling = self.config.noise_m_per_sqrt_m.powi(2) * integral.sum.abs();
        // The rounding error of a speed is constant while the speed is constant.
        let by_speed = NOISE_MPS * integral.interval_s;
        let by_time = self.config.time_sigma_s * integral.change;
        // Both ends are anywhere within a tick.
        let by_ticks_m2 = self.config.m_per_tick.unwrap_or_default().powi(2) / 6.0;
        Some(WheelDistance {
            distance_m: integral.sum,
            variance_m2: of_rolling + by_speed * by_speed + by_time * by_time + by_ticks_m2,
            side_variance_m2: of_rolling,
            interval_s: integral.interval_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::Sample;
    use proptest::prelude::*;

    const MS: i64 = 1_000_000;

    fn wheels(samples: [&[Sample]; 2]) -> Wheels {
        let mut wheels = Wheels::new(&WheelsConfig::default());
        for (sweep, samples) in (0..).zip(samples) {
            let [start, end] = [sweep * 250 * MS, (sweep + 1) * 250 * MS];
            wheels.push(samples, start + 125 * MS, [start, end]);
        }
        wheels
    }

    proptest! {
        /// A speed that grows evenly is integrated exactly, and samples of a gyro between are not
        /// looked at.
        #[test]
        fn the_distance_is_the_integral_of_the_speed(
            first in 0i64..100, every in 1usize..100, speed in -30.0..30.0f64,
        ) {
            let sample = |ms: i64| {
                let speed_mps = speed * (1.0 + 1e-3 * ms as f64);
                [Sample::yaw_rate(ms * MS, 9.0), Sample::speed(ms * MS, speed_mps)]
            };
            let all: Vec<Sample> = (first..=501).step_by(every).flat_map(sample).collect();
            let (before, after) = all.split_at(all.partition_point(|it| it.stamp_ns <= 250 * MS));
            let distance = wheels([before, after]).distance().unwrap_or_default();
            prop_assert!((distance.distance_m - 0.25 * speed * 1.25).abs() < 1e-9, "{distance:?}");
            let config = WheelsConfig::default();
            let least = config.noise_m_per_sqrt_m.powi(2) * distance.distance_m.abs();
            prop_assert!(distance.variance_m2 > least && distance.side_variance_m2 == least);
        }
    }
}
