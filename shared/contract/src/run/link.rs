//! The section `[link]`.

use std::{path::PathBuf, time::Duration};

use serde::{Deserialize, Serialize};

use crate::run::PlayedFrom;

/// The side of a run that is split between two machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The source, and the stages up to the cut.
    Robot,
    /// The stages after the cut, and the results.
    Base,
}

/// A run that is split between two machines: section `[link]`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinkConfig {
    /// The side that this machine has: `robot`, with the source and the stages up to the cut, or
    /// `base`, with those after it. Default: the run is not split.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub side: Option<Side>,
    /// Topic that splits the run: `scan`, `masked`, `rotation`, `motion` or `refined`. The stage
    /// that publishes it is the last one on the robot.
    pub cut: PlayedFrom,
    /// Name of the link, equal on both sides, and different for each robot.
    pub name: String,
    /// Where this side waits for the other, as in `tls/0.0.0.0:7447`; `tcp/` on loopback addresses
    /// alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub listen: Vec<String>,
    /// Where this side reaches the other, or a router between them, as in `tls/base.internal:7447`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub connect: Vec<String>,
    /// Certificate of the authority that has signed the certificates of both sides, PEM.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub ca: PathBuf,
    /// Certificate of this side, PEM.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub certificate: PathBuf,
    /// Private key of the certificate, PEM.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub key: PathBuf,
    /// True if a robot sends masked scans beside a later cut: the keyframes of SLAM need them. Set
    /// by `slam.kind`.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(skip)]
    pub keyframes: bool,
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self {
            side: None,
            cut: PlayedFrom::Masked,
            name: "gyre".to_owned(),
            listen: Vec::new(),
            connect: Vec::new(),
            ca: PathBuf::new(),
            certificate: PathBuf::new(),
            key: PathBuf::new(),
            keyframes: false,
        }
    }
}

impl LinkConfig {
    /// Time that a base waits at the end for the robot to know that the base has all of the run.
    pub const END_TIMEOUT: Duration = Duration::from_secs(60);

    /// Returns which part of a split run this is, a sentence; `None`: the run is not split.
    pub fn describe(&self) -> Option<String> {
        let (name, cut) = (&self.name, self.cut.name());
        match self.side? {
            Side::Robot => Some(format!(
                "link {name}: the stages up to `{cut}` are here; scans wait for the base"
            )),
            Side::Base => Some(format!(
                "link {name}: the stages after `{cut}` are here; they wait for the robot"
            )),
        }
    }

    /// Returns whether motions go back from the searches to masking, over the cut.
    pub fn returns_motions(&self) -> bool {
        matches!(self.cut, PlayedFrom::Masked | PlayedFrom::Rotation)
    }
}
