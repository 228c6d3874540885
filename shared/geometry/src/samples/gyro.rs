use bytemuck::{Pod, Zeroable};

use crate::{
    Twist,
    samples::{GyroConfig, integral::Integrator},
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
