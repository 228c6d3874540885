use bytemuck::{Pod, Zeroable};

use crate::{
    Twist,
    samples::{Sample, SensorConfigs, Witness, integral::Integrator},
};

/// A measurement by another sensor than the radar about the motion from the scan before to a scan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Evidence {
    /// Number of the samples, or of the bearings, that determine it; zero: it was not measured.
    pub samples: u64,
    /// From the stamp of the scan before to the stamp of the scan, s; zero of a velocity and of a
    /// heading.
    pub interval_s: f64,
    /// Of a gyro: the turn, rad, and the mean rate during the sweep, rad/s, both with the bias. Of
    /// wheels: the distance ahead, m. Of Doppler: the velocity ahead and to the left, m/s. Of an
    /// absolute heading: the heading at the stamp, rad.
    pub value: [f64; 2],
    /// Variance of the first value, covariance, variance of the second, but for the errors that all
    /// motions share: bias and scale.
    pub covariance: [f64; 3],
}

/// The evidence of each kind about one motion, in the order of [`Witness::ALL`].
pub type AllEvidence = [Evidence; Witness::ALL.len()];

impl Evidence {
    pub const NONE: Self = Self {
        samples: 0,
        interval_s: 0.0,
        value: [0.0; 2],
        covariance: [0.0; 3],
    };

    /// Returns itself; `None` if nothing was measured.
    pub fn measured(&self) -> Option<&Self> {
        (self.samples > 0).then_some(self)
    }
}

/// The sensors whose samples come with the scans. The evidence for a scan depends only on the
/// samples that came with it and with the scan before.
#[derive(Clone, Debug)]
pub struct SampledSensors {
    configs: SensorConfigs,
    /// In the order of [`Witness::ALL`].
    integrators: [Option<Integrator>; Witness::ALL.len()],
}

impl SampledSensors {
    pub fn new(configs: &SensorConfigs) -> Self {
        Self {
            integrators: Witness::ALL.map(|kind| configs.of(kind).map(Integrator::new)),
            configs: configs.clone(),
        }
    }

    /// Takes the samples that come with the next scan, in the order of their stamps, and the times
    /// of its stamp and of its first and last azimuth, ns.
    pub fn push(&mut self, samples: &[Sample], stamp_ns: i64, span_ns: [i64; 2]) {
        let all = self.integrators.iter_mut().flatten();
        all.for_each(|it| it.push(samples, stamp_ns, span_ns));
    }

    /// Takes the samples of a dropped scan: they count as samples of the next scan.
    pub fn drop_scan(&mut self, samples: &[Sample]) {
        let all = self.integrators.iter_mut().flatten();
        all.for_each(|it| it.drop_scan(samples));
    }

    pub fn clear(&mut self) {
        let all = self.integrators.iter_mut().flatten();
        all.for_each(Integrator::clear);
    }

    /// Returns the evidence about the motion to the last scan; nothing is measured where samples
    /// are missing.
    pub fn evidence(&self) -> AllEvidence {
        Witness::ALL.map(|kind| {
            let integrator = self.integrators[kind as usize].as_ref();
            let measured = self.configs.of(kind).zip(integrator);
            let measured = measured.and_then(|(config, it)| config.measure(it));
            measured.unwrap_or_default()
        })
    }

    /// Returns the velocities for the compensation of the sweeps of the scan before and of the
    /// scan: with the mean rate of the gyro during the sweep, if it has measured one.
    pub fn with_yaw_rates(&self, twists: [Option<Twist>; 2]) -> [Option<Twist>; 2] {
        let gyro = self.integrators[Witness::Gyro as usize].as_ref();
        let [before, later] = gyro.map_or([None; 2], Integrator::means);
        let [of_before, of_later] = twists;
        [(of_before, before), (of_later, later)].map(|(twist, rate)| {
            twist.map(|twist| Twist {
                yaw_rate_radps: rate.unwrap_or(twist.yaw_rate_radps),
                ..twist
            })
        })
    }
}
