//! The section `[refinement]`.

use serde::{Deserialize, Serialize};

/// How to refine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefinementConfig {
    /// `none`: poses are made of the search's motions, and the run has no such process. `local-map`: they are refined first.
    /// Default `none`.
    pub kind: RefinementKind,
}

/// What motions are refined against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RefinementKind {
    /// Nothing.
    #[default]
    None,
    /// What was seen last.
    LocalMap,
}
