use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::backend::{Backend, Provider};

/// The mask and motion compensation: section `[masking]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MaskingConfig {
    /// `none`: everything counts. `threshold`: power up to `threshold` counts as zero. `learned`:
    /// in addition, a network weights each cell.
    pub kind: MaskKind,
    /// Highest power that counts as zero, 0 to 255, before any network. Rasters hold the power less
    /// the threshold.
    pub threshold: u8,
    /// Model card of the network, as `models/NAME.toml`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// SHA-256 of the network, to refuse a different one. Default: the one of its card.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// The library that computes the network, and the network of moving objects: `onnxruntime`;
    /// `rten`, which is built in and slower; or `auto`: ONNX Runtime where it is found, else rten.
    pub backend: Backend,
    /// The library of ONNX Runtime, or its folder. Default: it is searched for, see docs/masks.md.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runtime: Option<PathBuf>,
    /// Threads of ONNX Runtime for masks, 1 to 64. rten has one, and so has the network of moving
    /// objects. The other stages work at the same time.
    pub threads: usize,
    /// Execution provider of the network: `cpu`, or `cuda`, `tensorrt` or `openvino` in a build
    /// with that feature.
    pub provider: Provider,
    /// Exponent of the mask of a network or function in the weights of the sparse points, 0 to 4: 0
    /// ignores the mask, 1 applies it as in the rasters. The weights are compressed powers, so the
    /// mask is compressed too; in full it gives the weakest single returns the largest weights.
    pub point_exponent: f32,
    /// True if rasters are motion compensated.
    pub compensate: bool,
    /// Motion compensation of scan k uses the motion of scan k - lag; 1 to 16. With 2 or more the
    /// stages overlap across scans.
    pub lag: usize,
    /// True if rasters are also compensated for the Doppler shift, with the same motion. At
    /// constant speed the shift cancels between rasters. Compensated, it cancels only between scans
    /// that both have a known motion, so the motion where compensation begins is short by the whole
    /// shift.
    pub undo_doppler: bool,
}

/// The kind of a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MaskKind {
    /// Everything counts.
    None,
    /// Weak returns count as zero.
    Threshold,
    /// A network weights the power above the threshold.
    Learned,
}

#[derive(Debug, Error, PartialEq)]
#[error("{0}")]
pub struct MaskingConfigError(String);

impl Default for MaskingConfig {
    fn default() -> Self {
        Self {
            kind: MaskKind::Threshold,
            threshold: 60,
            model: None,
            sha256: None,
            backend: Backend::Auto,
            runtime: None,
            threads: 1,
            provider: Provider::Cpu,
            point_exponent: 0.5,
            compensate: true,
            lag: 2,
            undo_doppler: false,
        }
    }
}

impl MaskingConfig {
    pub fn validate(&self) -> Result<(), MaskingConfigError> {
        let (threads, exponent) = (self.threads, self.point_exponent);
        let is_rten = self.backend == Backend::Rten;
        let not_of_rten = |key| {
            format!(
                "backend is `rten`, but {key} is a setting of ONNX Runtime: set backend to `onnxruntime`, or leave {key} out"
            )
        };
        Err(MaskingConfigError(match () {
            () if !(1..=64).contains(&threads) => {
                format!("threads is {threads}, but must be 1 to 64")
            }
            () if !(0.0..=4.0).contains(&exponent) => {
                format!("point_exponent is {exponent}, but must be 0 to 4")
            }
            () if is_rten && self.runtime.is_some() => not_of_rten("runtime"),
            () if is_rten && self.provider != Provider::Cpu => not_of_rten("provider"),
            () if self.compensate && self.lag == 0 => {
                "lag is 0, but must be 1 or more: the motion of a scan is not known before its search".to_owned()
            }
            () => return Ok(()),
        }))
    }

    pub fn floor(&self) -> u8 {
        match self.kind {
            MaskKind::None => 0,
            MaskKind::Threshold | MaskKind::Learned => self.threshold,
        }
    }

    pub fn feedback_lag(&self) -> usize {
        if self.compensate { self.lag } else { 0 }
    }
}
