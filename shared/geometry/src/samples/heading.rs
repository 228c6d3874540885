//! The heading itself, of a GNSS receiver with two antennas or of a compass.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    bounds::{DELAY, GAP, NOISE, SettingError, WAIT},
    check_bounds,
    samples::{
        Evidence, Sample, SampleKind, SensorKind, UpAxis,
        config::{on_clock, sensor_config},
        integral::Integrator,
    },
    wrap_angle,
};

/// Configuration of absolute headings: section `[heading]`.
///
/// The offset between them and the headings of the radar need not be known: how the antennas are
/// mounted, the convergence of a grid, the declination of a compass. The default noise suits two
/// antennas that are a metre apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HeadingConfig {
    /// Whose headings are used. Bags and drivers of ROS 2 have none.
    pub kind: SensorKind,
    /// The log, for `kind = "log"`: a table as CSV whose first row names its columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The address and port for receiving datagrams of a live receiver: lines of a stamp (ns since
    /// 1970) and the heading (rad, counter-clockwise from east), with a comma between.
    pub listen: String,
    /// Longest time for which a scan of a live radar waits for its samples, ms.
    pub max_wait_ms: f64,
    /// Delay of the stamps of the headings against the radar's, s: it is subtracted from them.
    pub delay_s: f64,
    /// Standard deviation of a heading, degrees.
    pub noise_deg: f64,
    /// Standard deviation of the time of a sample against the radar's clock, s.
    pub time_sigma_s: f64,
    /// Longest time between two samples over which the heading is interpolated, s.
    pub max_gap_s: f64,
}

impl Default for HeadingConfig {
    fn default() -> Self {
        Self {
            kind: SensorKind::None,
            file: None,
            listen: "127.0.0.1:6324".to_owned(),
            max_wait_ms: 20.0,
            delay_s: 0.0,
            noise_deg: 0.5,
            time_sigma_s: 0.01,
            max_gap_s: 0.25,
        }
    }
}

sensor_config! { HeadingConfig is Heading:
    fn validate(&self) -> Result<(), SettingError> {
        check_bounds! { self, "heading":
            delay_s in DELAY,
            max_wait_ms in WAIT,
            noise_deg in ([0.01, 90.0], "degrees, 0.01 to 90"),
            time_sigma_s in NOISE,
            max_gap_s in GAP,
        }
        Ok(())
    }

    fn max_wait_ms(&self) -> f64 {
        self.max_wait_ms
    }

    fn max_gap_s(&self) -> f64 {
        self.max_gap_s
    }

    /// Returns the heading at the stamp of the scan, between the samples before and after it.
    fn measure(&self, between: &Integrator) -> Option<Evidence> {
        let (rates, stamp_ns) = (&between.rates, between.stamp_ns()?);
        let next = rates.partition_point(|(at_ns, _)| *at_ns < stamp_ns);
        let [before, after] = [rates.get(next.checked_sub(1)?)?, rates.get(next)?];
        let seconds = |at_ns: i64| (at_ns - before.0) as f64 * 1e-9;
        let (apart_s, turn_rad) = (seconds(after.0), wrap_angle(after.1 - before.1));
        let by_time = self.time_sigma_s * turn_rad / apart_s;
        let heading_rad = before.1 + turn_rad * seconds(stamp_ns) / apart_s;
        (apart_s <= self.max_gap_s).then(|| Evidence {
            samples: 2,
            interval_s: 0.0,
            value: [wrap_angle(heading_rad), 0.0],
            covariance: [self.noise_deg.to_radians().powi(2) + by_time * by_time, 0.0, 0.0],
        })
    }

    fn on_radar(&self, sample: &Sample, _: Option<UpAxis>) -> Sample {
        let heading_rad = wrap_angle(sample.values[0]);
        Sample::heading(on_clock(sample, self.delay_s), heading_rad)
    }
}

impl Sample {
    /// Creates a sample of a heading, rad counter-clockwise from east.
    pub fn heading(stamp_ns: i64, heading_rad: f64) -> Self {
        let values = [heading_rad, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self::of(SampleKind::Heading, stamp_ns, values)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::samples::SensorConfig as _;

    const MS: i64 = 1_000_000;

    /// The evidence for a scan of 250 to 500 ms by headings at these times, ms.
    fn measured(
        config: &HeadingConfig,
        stamps: &[i64],
        heading: impl Fn(f64) -> f64,
    ) -> Option<Evidence> {
        let mut between = Integrator::new(config);
        for start in [0, 250] {
            let stamps = stamps
                .iter()
                .filter(|ms| (start + 1..=start + 250).contains(*ms));
            let samples =
                stamps.map(|ms| Sample::heading(ms * MS, wrap_angle(heading(*ms as f64 * 1e-3))));
            let samples: Vec<Sample> = samples.collect();
            between.push(
                &samples,
                (start + 125) * MS,
                [start * MS, (start + 250) * MS],
            );
        }
        config.measure(&between)
    }

    proptest! {
        /// A heading that turns evenly is interpolated exactly, wherever it passes 180 degrees.
        #[test]
        fn the_heading_is_interpolated_across_the_wrap(
            start in -10.0..10.0f64, rate in -10.0..10.0f64, first in 1i64..50, every in 1usize..100,
        ) {
            let config = HeadingConfig { noise_deg: 1.0, time_sigma_s: 0.02, ..HeadingConfig::default() };
            let stamps: Vec<i64> = (first..=500).step_by(every).collect();
            let heading = |time_s: f64| start + rate * time_s;
            let evidence = measured(&config, &stamps, heading).unwrap_or_default();
            prop_assert!(wrap_angle(evidence.value[0] - heading(0.375)).abs() < 1e-9, "{evidence:?}");
            prop_assert!(evidence.value[0].abs() <= std::f64::consts::PI);
            let variance = 1f64.to_radians().powi(2) + (0.02 * rate).powi(2);
            prop_assert!((evidence.covariance[0] - variance).abs() < 1e-9 && evidence.interval_s == 0.0);
        }
    }

    #[test]
    fn nothing_is_made_up_without_samples_on_both_sides_that_are_near() {
        let config = HeadingConfig::default();
        for (stamps, is_measured) in [
            (&[300, 400][..], true),
            (&[300, 375], true),
            (&[150, 400], true),
            (&[140, 400], false),
            (&[100, 300], false),
            (&[400, 450], false),
            (&[], false),
        ] {
            assert_eq!(
                measured(&config, stamps, |_| 0.3).is_some(),
                is_measured,
                "{stamps:?}"
            );
        }
    }
}
