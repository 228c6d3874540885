//! The section `[objects]` of a configuration.

use gyre_masking::networks::PlanesError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest score, so that an object that has gone ends soon.
pub(crate) const MAX_SCORE: f64 = 4.0;

/// The kind of the tracking.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsConfig {
    /// `none` or `tracks`. Default `none`.
    pub kind: ObjectsKind,
    /// Likelihood at which the network is as often wrong as right. Default 0.35: it was trained to
    /// miss rather than to invent. Less finds more, and more that is false.
    pub even_likely: f64,
    /// Least score of a track that becomes an object: the sum of the log-likelihood ratios of an
    /// object to no object. More finds less, and less that is false. Default 1.
    pub confirm_score: f64,
}

impl Default for ObjectsConfig {
    fn default() -> Self {
        Self {
            kind: ObjectsKind::None,
            even_likely: 0.35,
            confirm_score: 1.0,
        }
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ObjectsError(String);

impl From<PlanesError> for ObjectsError {
    fn from(error: PlanesError) -> Self {
        Self(error.to_string())
    }
}

impl ObjectsConfig {
    pub fn is_on(&self) -> bool {
        self.kind == ObjectsKind::Tracks
    }

    pub fn validate(&self) -> Result<(), ObjectsError> {
        let require = |key: &str, value: f64, (low, high), bounds: &str| {
            let refused = || format!("objects.{key} is {value}, but must be {bounds}");
            match (low..=high).contains(&value) {
                true => Ok(()),
                false => Err(ObjectsError(refused())),
            }
        };
        let likely = (0.01, 0.99);
        require("even_likely", self.even_likely, likely, "0.01 to 0.99")?;
        let confirmed = (0.0, MAX_SCORE);
        require("confirm_score", self.confirm_score, confirmed, "0 to 4")
    }
}

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
            change(|it| it.even_likely = f64::NAN),
            refused("objects.even_likely is NaN, but must be 0.01 to 0.99")
        );
        assert_eq!(
            change(|it| it.confirm_score = 5.0),
            refused("objects.confirm_score is 5, but must be 0 to 4")
        );
    }
}
