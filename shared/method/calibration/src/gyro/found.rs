//! The results for a gyro, as a table and as a section of a configuration.

use std::path::Path;

use gyre_geometry::samples::{GyroConfig, UpAxis};

use super::ClockError;
use crate::Estimate;

/// A scale that is less certain adds nothing to the default.
const USEFUL_SCALE_SIGMA: f64 = 0.01;
/// A drift that differs from none by so many standard deviations is one.
const DRIFT_SIGMAS: f64 = 3.0;

/// The clock and the axes of a gyro, by the turns of the radar.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroCalibration {
    pub up: UpAxis,
    pub delay_s: Estimate,
    /// Change of that time, s/s.
    pub drift: Estimate,
    /// True yaw rate over the measured one.
    pub scale: Estimate,
    /// Bias, rad/s: scaled rate less true one.
    pub bias_radps: Estimate,
    /// Correlation of the turns with the radar's.
    pub correlation: f64,
    /// Number of turns that were compared, of a second each.
    pub turns: usize,
}

impl GyroCalibration {
    /// Returns the mean over drives of one gyro, each weighted by its uncertainty.
    pub fn mean(&self, others: &[Self]) -> Result<Self, ClockError> {
        let mut mean = self.clone();
        for other in others {
            if other.up != mean.up {
                let [one, other] = [&mean, other].map(|it| it.up.name());
                return Err(ClockError(format!(
                    "one drive has {one} up, a different drive {other}: these are not logs of one gyro as it is mounted"
                )));
            }
            mean.delay_s = mean.delay_s.combined(&other.delay_s);
            mean.drift = mean.drift.combined(&other.drift);
            mean.scale = mean.scale.combined(&other.scale);
            mean.bias_radps = mean.bias_radps.combined(&other.bias_radps);
            mean.correlation = mean.correlation.min(other.correlation);
            mean.turns += other.turns;
        }
        Ok(mean)
    }

    pub fn drifts(&self) -> bool {
        self.drift.value.abs() > DRIFT_SIGMAS * self.drift.sigma
    }

    fn tells_scale(&self) -> bool {
        self.scale.sigma < USEFUL_SCALE_SIGMA
    }

    /// Returns the section `[gyro]`, with the log if it does not lie beside the scans.
    pub fn toml(&self, file: Option<&Path>) -> String {
        let (late, scale, bias) = (self.delay_s, self.scale, self.bias_radps);
        let mut text = format!("\n[gyro]\n{}", log_keys(file));
        text += &format!(
            "up = \"{}\" # correlation {:.3} of {} turns with those of the radar\n",
            self.up.name(),
            self.correlation,
            self.turns
        );
        text += &format!(
            "delay_s = {:.4}\ntime_sigma_s = {:.4}\n",
            late.value,
            late.sigma.max(1e-4)
        );
        text += &match self.tells_scale() {
            true => format!(
                "scale = {:.4}\nscale_sigma = {:.4}\n",
                scale.value, scale.sigma
            ),
            false => format!("# scale stays as configured: {scale} is no better\n"),
        };
        text + &format!(
            "bias_radps = {:.6} # \u{b1} {:.6} in this drive: the next one may begin with another\n",
            bias.value, bias.sigma
        )
    }

    pub fn table(&self, configured: &GyroConfig) -> String {
        let used = |value: f64| configured.is_used().then_some(value);
        let up = configured.up.unwrap_or(self.up);
        let axis = match configured.is_used() && up != self.up {
            true => format!(
                ", configured {}: CONTRADICTS the configured value",
                up.name()
            ),
            false => String::new(),
        };
        let (late, scale, drift) = (&self.delay_s, &self.scale, &self.drift);
        let drifts = match self.drifts() {
            true => ": one delay_s does not do for a long drive",
            false => "",
        };
        let tells = match self.tells_scale() {
            true => scale.verdict(used(configured.scale)),
            false => ", which is not determined well enough".to_owned(),
        };
        [
            format!(
                "{:<21} {}{axis}\n{:<21} {} turns of a second, correlation {:.4}",
                "gyro, axis up",
                self.up.name(),
                "",
                self.turns,
                self.correlation
            ),
            format!(
                "{:<21} {late} s{}\n{:<21} drift {:.0} ppm{drifts}",
                "gyro, late by",
                late.verdict(used(configured.delay_s)),
                "",
                drift.times(1e6)
            ),
            format!("{:<21} {scale}{tells}", "gyro, scale"),
            format!(
                "{:<21} {} deg/s in this drive",
                "gyro, bias",
                self.bias_radps.times(1f64.to_degrees())
            ),
        ]
        .join("\n")
    }
}

/// Returns the keys of the log of a sensor, which lies beside the scans if no file is named.
pub(crate) fn log_keys(file: Option<&Path>) -> String {
    match file.map(|file| toml::Value::from(file.display().to_string())) {
        Some(file) => format!("kind = \"log\"\nfile = {file}\n"),
        None => "kind = \"auto\"\n".to_owned(),
    }
}
