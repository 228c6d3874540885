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

impl ObjectsConfig {
    pub fn is_on(&self) -> bool {
        self.kind == ObjectsKind::Tracks
    }
}
