//! The results for a sensor, as a table and as a section of a configuration.

use std::path::{Path, PathBuf};

use gyre_geometry::samples::UpAxis;

use super::{ClockError, Kind};
use crate::Estimate;

/// A drift that differs from none by so many standard deviations is one.
const DRIFT_SIGMAS: f64 = 3.0;

/// The clock, the axis, the scale and the bias of a sensor, by the motions of the radar.
#[derive(Clone, Debug)]
pub struct SensorCalibration {
    pub kind: &'static Kind,
    /// The axis that points up, of a kind with several.
    pub up: Option<UpAxis>,
    pub delay_s: Estimate,
    /// Change of that time, s/s.
    pub drift: Estimate,
    /// True measurement over the logged one.
    pub scale: Estimate,
    /// Bias, rad/s: scaled rate less true one.
    pub bias: Estimate,
    /// Correlation of the turns or distances with the radar's.
    pub correlation: f64,
    /// Number of turns or distances that were compared, of a second each.
    pub count: usize,
}

/// The settings of a sensor that its calibration needs, and is compared with.
#[derive(Clone, Debug, Default)]
pub struct SensorSettings {
    pub is_used: bool,
    /// The log, if the settings name it.
    pub file: Option<PathBuf>,
    pub up: Option<UpAxis>,
    pub m_per_tick: Option<f64>,
    pub delay_s: f64,
    pub scale: f64,
    pub max_gap_s: f64,
}

impl SensorCalibration {
    /// Returns the mean over drives of one sensor, each weighted by its uncertainty.
    pub fn mean(&self, others: &[Self]) -> Result<Self, ClockError> {
        let mut mean = self.clone();
        for other in others {
            if let (Some(one), Some(other)) = (mean.up, other.up)
                && one != other
            {
                return Err(ClockError(format!(
                    "one drive has {} up, a different drive {}: these are not logs of one {} as it is mounted",
                    one.name(),
                    other.name(),
                    self.kind.sensor.section()
                )));
            }
            mean.delay_s = mean.delay_s.combined(&other.delay_s);
            mean.drift = mean.drift.combined(&other.drift);
            mean.scale = mean.scale.combined(&other.scale);
            mean.bias = mean.bias.combined(&other.bias);
            mean.correlation = mean.correlation.min(other.correlation);
            mean.count += other.count;
        }
        Ok(mean)
    }

    pub fn drifts(&self) -> bool {
        self.drift.value.abs() > DRIFT_SIGMAS * self.drift.sigma
    }

    fn tells_scale(&self) -> bool {
        self.scale.sigma < self.kind.useful_scale_sigma
    }

    /// Returns the section, with the log if it does not lie beside the scans, and the distance of
    /// a tick that the scale is of.
    pub fn toml(&self, file: Option<&Path>, m_per_tick: Option<f64>) -> String {
        let (late, scale, bias) = (self.delay_s, self.scale, self.bias);
        let compared = format!(
            " # correlation {:.3} of {} {} with those of the radar",
            self.correlation, self.count, self.kind.compared
        );
        let mut text = format!("\n[{}]\n{}", self.kind.sensor.section(), log_keys(file));
        if let Some(metres) = m_per_tick {
            text += &format!("m_per_tick = {metres}\n");
        }
        let after_scale = match self.up {
            Some(up) => {
                text += &format!("up = \"{}\"{compared}\n", up.name());
                ""
            }
            None => &compared,
        };
        text += &format!(
            "delay_s = {:.4}\ntime_sigma_s = {:.4}\n",
            late.value,
            late.sigma.max(1e-4)
        );
        text += &match self.tells_scale() {
            true => format!(
                "scale = {:.4}\nscale_sigma = {:.4}{after_scale}\n",
                scale.value, scale.sigma
            ),
            false => format!("# scale stays as configured: {scale} is no better\n"),
        };
        if self.kind.has_bias {
            text += &format!(
                "bias_radps = {:.6} # \u{b1} {:.6} in this drive: the next one may begin with another\n",
                bias.value, bias.sigma
            );
        }
        text
    }

    pub fn table(&self, configured: &SensorSettings) -> String {
        let used = |value: f64| configured.is_used.then_some(value);
        let (late, scale) = (&self.delay_s, &self.scale);
        let compared = format!(
            "{} {} of a second, correlation {:.4}",
            self.count, self.kind.compared, self.correlation
        );
        let axis = self.up.map(|found| match configured.up {
            Some(up) if configured.is_used && up != found => format!(
                "{}, configured {}: CONTRADICTS the configured value",
                found.name(),
                up.name()
            ),
            _ => found.name().to_owned(),
        });
        let drifts = match self.drifts() {
            true => ": one delay_s does not do for a long drive",
            false => "",
        };
        let tells = match self.tells_scale() {
            true => scale.verdict(used(configured.scale)),
            false => ", which is not determined well enough".to_owned(),
        };
        let delay = format!("{late} s{}", late.verdict(used(configured.delay_s)));
        let drift = format!("drift {:.0} ppm{drifts}", self.drift.times(1e6));
        let bias = self.bias.times(1f64.to_degrees());
        let bias = format!("{bias} deg/s in this drive");
        // The lines without a name belong to the line before.
        let has_axis = self.up.is_some();
        let rows = [
            axis.map(|axis| ("axis up", axis)),
            has_axis.then(|| ("", compared.clone())),
            Some(("late by", delay)),
            self.kind.has_bias.then_some(("", drift)),
            Some(("scale", format!("{scale}{tells}"))),
            self.kind.has_bias.then_some(("bias", bias)),
            (!has_axis).then_some(("", compared)),
        ];
        let line = |(name, rest): (&str, String)| {
            let name = match name {
                "" => String::new(),
                name => format!("{}, {name}", self.kind.sensor.section()),
            };
            format!("{name:<21} {rest}")
        };
        let lines: Vec<String> = rows.into_iter().flatten().map(line).collect();
        lines.join("\n")
    }
}

/// Returns the keys of the log of a sensor, which lies beside the scans if no file is named.
fn log_keys(file: Option<&Path>) -> String {
    match file.map(|file| toml::Value::from(file.display().to_string())) {
        Some(file) => format!("kind = \"log\"\nfile = {file}\n"),
        None => "kind = \"auto\"\n".to_owned(),
    }
}
