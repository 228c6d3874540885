//! The section `[objects]` of a configuration.

use gyre_networks::PlanesError;
use serde::{Deserialize, Serialize};

/// The kind of the tracking.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectsKind {
    /// No objects.
    #[default]
    None,
    /// Moving objects are found by a network and tracked by Kalman filters.
    Tracks,
}

/// The tracking of moving objects: the section `[objects]`.
///
/// The constants suit road vehicles, and radars that turn four times a second; the constants of the
/// score were chosen on simulated drives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsConfig {
    /// `none` or `tracks`. Default `none`.
    pub kind: ObjectsKind,
    /// Least likelihood, by the network, of a place that counts as a moving vehicle's. Default 0.1:
    /// a less likely place keeps no track alive.
    pub least_likely: f64,
    /// Likelihood where the network is as often wrong as right. Default 0.35: it was trained to
    /// miss rather than to invent. Less finds more, and more that is false.
    pub even_likely: f64,
    /// Least score of a track that becomes an object: the sum of the log-likelihood ratios of an
    /// object to no object. More finds less, and less that is false. Default 1.
    pub confirm_score: f64,
    /// Least score of an object in a scan that is reported. Default 0.
    pub keep_score: f64,
    /// The score below which a track ends. Default -2.
    pub end_score: f64,
    /// The largest score, so that an object that has gone ends soon. Default 4.
    pub max_score: f64,
    /// Loss of the score by a scan that does not show the object. Default 1.
    pub missed_loss: f64,
    /// Scans that show a track before it is an object. Default 2.
    pub birth_hits: u32,
    /// Time that a track is continued without being seen, s: a car that passes hides another for
    /// about one. Default 1.
    pub coast_s: f64,
    /// Time for which an object that is not seen keeps its identity, s. Default 8: then it may be
    /// anywhere.
    pub lost_s: f64,
    /// The same of one that had stopped, s. Default 60: a red light.
    pub stopped_s: f64,
    /// Speed below which an object that is lost has stopped, m/s. Default 2.
    pub stopping_mps: f64,
    /// Time between two scans beyond which all tracks end, s. Default 2: by then a car at walking
    /// pace is elsewhere.
    pub max_gap_s: f64,
    /// Largest squared Mahalanobis distance, by place and velocity, between a detection and a
    /// prediction that can be one object. Default 50: more than its own noise, so that one that
    /// brakes hard or turns off is within it.
    pub gate: f64,
    /// Factor of the standard deviation that the network gives of a velocity. Default 2: five of
    /// six scans that it sees are those that it saw before, and so is most of the error.
    pub velocity_sigmas: f64,
    /// Standard deviation of the heading that the network gives, rad. Default 0.2.
    pub heading_sigma_rad: f64,
    /// Standard deviation of an object's acceleration along its way, m/s²: vehicles brake and
    /// accelerate with 1 to 3. Default 1.5.
    pub acceleration_mps2: f64,
    /// Standard deviation of its acceleration across its path beyond a turn's, m/s²: a change of
    /// lane has about 1. Default 1.
    pub lateral_acceleration_mps2: f64,
    /// Largest turn rate, rad/s: a car turns off at 7 m/s on a radius of 10 m. Default 0.7.
    pub turn_rate_radps: f64,
    /// Mean time for which a turn rate lasts, s: a driver steers into a corner, and out of it, in
    /// about that. Default 0.5.
    pub turn_lasts_s: f64,
    /// Highest speed of an object that counts as standing, m/s: the odometry's own error, and
    /// motion by wind. Default 0.8.
    pub standing_mps: f64,
    /// Speed above which its direction is the heading, m/s. Default 1: below, noise turns it.
    pub heading_mps: f64,
    /// Least excess of the speed of a moving object over `standing_mps`, in standard deviations.
    /// Default 1.
    pub moving_sigmas: f64,
}

impl Default for ObjectsConfig {
    fn default() -> Self {
        Self {
            kind: ObjectsKind::None,
            least_likely: 0.1,
            even_likely: 0.35,
            confirm_score: 1.0,
            keep_score: 0.0,
            end_score: -2.0,
            max_score: 4.0,
            missed_loss: 1.0,
            birth_hits: 2,
            coast_s: 1.0,
            lost_s: 8.0,
            stopped_s: 60.0,
            stopping_mps: 2.0,
            max_gap_s: 2.0,
            gate: 50.0,
            velocity_sigmas: 2.0,
            heading_sigma_rad: 0.2,
            acceleration_mps2: 1.5,
            lateral_acceleration_mps2: 1.0,
            turn_rate_radps: 0.7,
            turn_lasts_s: 0.5,
            standing_mps: 0.8,
            heading_mps: 1.0,
            moving_sigmas: 1.0,
        }
    }
}

/// An error of the tracking of objects.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjectsError {
    #[error("objects.{key} is {value}, but must be {bounds}")]
    Setting {
        key: &'static str,
        value: f64,
        bounds: &'static str,
    },
    #[error("{0}")]
    Network(String),
}

impl From<PlanesError> for ObjectsError {
    fn from(error: PlanesError) -> Self {
        Self::Network(error.to_string())
    }
}

impl ObjectsConfig {
    /// Returns whether objects are tracked.
    pub fn is_on(&self) -> bool {
        self.kind == ObjectsKind::Tracks
    }

    /// Checks the bounds of all settings.
    pub fn validate(&self) -> Result<(), ObjectsError> {
        let positive = self.positive();
        let positive = positive.map(|(key, value)| (key, value, (1e-3, 1000.0), "0.001 to 1000"));
        for (key, value, (low, high), bounds) in self.scores().into_iter().chain(positive) {
            if !(low..=high).contains(&value) {
                return Err(ObjectsError::Setting { key, value, bounds });
            }
        }
        Ok(())
    }

    fn scores(&self) -> [Setting; 11] {
        const LIKELY: (f64, f64) = (0.01, 0.99);
        const LARGE: (f64, f64) = (0.0, 1000.0);
        const BELOW: (f64, f64) = (-1000.0, 0.0);
        let confirmed = (0.0, self.max_score);
        let hits = f64::from(self.birth_hits);
        [
            ("least_likely", self.least_likely, LIKELY, "0.01 to 0.99"),
            ("even_likely", self.even_likely, LIKELY, "0.01 to 0.99"),
            ("max_score", self.max_score, LARGE, "0 to 1000"),
            (
                "confirm_score",
                self.confirm_score,
                confirmed,
                "0 to max_score",
            ),
            ("end_score", self.end_score, BELOW, "-1000 to 0"),
            (
                "keep_score",
                self.keep_score,
                (self.end_score, self.max_score),
                "end_score to max_score",
            ),
            ("missed_loss", self.missed_loss, LARGE, "0 to 1000"),
            ("birth_hits", hits, (1.0, 32.0), "1 to 32"),
            ("coast_s", self.coast_s, (0.0, 30.0), "0 to 30"),
            ("lost_s", self.lost_s, LARGE, "0 to 1000"),
            ("stopped_s", self.stopped_s, LARGE, "0 to 1000"),
        ]
    }

    fn positive(&self) -> [(&'static str, f64); 12] {
        [
            ("stopping_mps", self.stopping_mps),
            ("max_gap_s", self.max_gap_s),
            ("gate", self.gate),
            ("velocity_sigmas", self.velocity_sigmas),
            ("heading_sigma_rad", self.heading_sigma_rad),
            ("acceleration_mps2", self.acceleration_mps2),
            ("lateral_acceleration_mps2", self.lateral_acceleration_mps2),
            ("turn_rate_radps", self.turn_rate_radps),
            ("turn_lasts_s", self.turn_lasts_s),
            ("standing_mps", self.standing_mps),
            ("heading_mps", self.heading_mps),
            ("moving_sigmas", self.moving_sigmas),
        ]
    }
}

/// A key, its value, its least and its largest value, and these in words.
type Setting = (&'static str, f64, (f64, f64), &'static str);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_within_their_bounds_and_the_first_fault_is_named() {
        assert_eq!(ObjectsConfig::default().validate(), Ok(()));
        let change = |change: fn(&mut ObjectsConfig)| {
            let mut config = ObjectsConfig::default();
            change(&mut config);
            config.validate().map_err(|error| error.to_string())
        };
        let refused = |sentence: &str| Err(sentence.to_owned());
        assert_eq!(
            change(|it| it.birth_hits = 0),
            refused("objects.birth_hits is 0, but must be 1 to 32")
        );
        assert_eq!(
            change(|it| it.coast_s = f64::NAN),
            refused("objects.coast_s is NaN, but must be 0 to 30")
        );
        assert_eq!(
            change(|it| it.confirm_score = 5.0),
            refused("objects.confirm_score is 5, but must be 0 to max_score")
        );
    }
}
