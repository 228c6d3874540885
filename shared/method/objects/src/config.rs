use gyre_masking::networks::PlanesError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsConfig {
    /// `none` or `tracks`.
    pub kind: ObjectsKind,
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
}
