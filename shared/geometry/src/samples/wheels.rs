use bytemuck::{Pod, Zeroable};

use crate::samples::{WheelsConfig, integral::Integrator};

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
