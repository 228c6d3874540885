//! Bounds of the settings of sensors beside the radar.

use thiserror::Error;

/// A setting of `[gyro]`, `[wheels]`, `[doppler]` or `[gnss]` out of its bounds.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{section}.{key} is {value}, but must be {expected}")]
pub struct SampleConfigError {
    pub section: &'static str,
    pub key: &'static str,
    pub value: f64,
    pub expected: &'static str,
}

pub(crate) struct Bounds(pub &'static str);

impl Bounds {
    pub fn within(
        &self,
        key: &'static str,
        value: f64,
        [least, most]: [f64; 2],
        expected: &'static str,
    ) -> Result<(), SampleConfigError> {
        match (least..=most).contains(&value) {
            true => Ok(()),
            false => Err(SampleConfigError {
                section: self.0,
                key,
                value,
                expected,
            }),
        }
    }

    pub fn delay_s(&self, value: f64) -> Result<(), SampleConfigError> {
        let expected = "seconds, at most a million";
        self.within("delay_s", value, [-1e6, 1e6], expected)
    }

    pub fn max_wait_ms(&self, value: f64) -> Result<(), SampleConfigError> {
        let expected = "milliseconds, 0 to 1000";
        self.within("max_wait_ms", value, [0.0, 1000.0], expected)
    }

    pub fn scale(&self, [scale, sigma]: [f64; 2]) -> Result<(), SampleConfigError> {
        self.within("scale", scale, [0.5, 2.0], "a factor, 0.5 to 2")?;
        self.within("scale_sigma", sigma, [0.0, 1.0], "a share, 0 to 1")
    }

    pub fn noise(&self, key: &'static str, value: f64) -> Result<(), SampleConfigError> {
        self.within(key, value, [0.0, 1.0], "0 to 1")
    }

    pub fn max_gap_s(&self, max_gap_s: f64) -> Result<(), SampleConfigError> {
        let expected = "seconds, 0.001 to 10";
        self.within("max_gap_s", max_gap_s, [1e-3, 10.0], expected)
    }
}
