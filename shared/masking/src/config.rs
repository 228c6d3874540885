//! The section `[masking]`.

use std::{fmt, path::PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{model::Card, network::NetworkError, runtime};

/// How to mask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MaskingConfig {
    /// `none`; `threshold`: power below [`MaskingConfig::threshold`] counts as nothing; or `learned`: besides, a network
    /// says for each cell how much it counts. Default `threshold`.
    pub kind: MaskKind,
    /// Power that counts as nothing, 0 to 255; a network does not even see it. Default 60.
    pub threshold: u8,
    /// The card of the network, `models/NAME.toml`: see [`crate::model::Card`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// The network's SHA-256, where it must not be another one. Default: what its card says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// ONNX Runtime's library, or the folder that it is in. Default: see [`crate::runtime::find`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub runtime: Option<PathBuf>,
    /// Threads that compute the network, 1 to 64. Default 1, for the other stages work at the same time.
    pub threads: usize,
    /// Who computes it: `cpu`, or one that Gyre was built for: `cuda`, `tensorrt`, `openvino`. Default `cpu`.
    pub provider: Provider,
    /// A sparse point's weight is multiplied by the network's mask to the power of this: 0, the mask says nothing of points;
    /// 1, it counts as it does in the rasters. A point's weight is its power compressed, so its mask is to be compressed
    /// too: in full it makes the faintest lone returns weigh the most. Default 0.5.
    pub point_exponent: f32,
    /// Undo the distortion that the vehicle's motion puts into a sweep. Default true.
    pub compensate: bool,
    /// Which motion to undo it with: that of the scan so many scans before, at least 1. With 2 or more the stages overlap
    /// across scans. Default 2.
    pub lag: usize,
    /// Undo Doppler's shift in the rasters too, with the same motion, where the scan knows it. At constant speed the shift
    /// cancels between rasters; undone, it cancels only between scans that both know their motion, and a motion seems
    /// too short by the whole shift where compensation sets in. Default false.
    pub undo_doppler: bool,
    /// Wait so long over each scan, ms: to see what happens under load. Default 0.
    pub stress_delay_ms: u64,
}

/// The masks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MaskKind {
    /// Everything counts.
    None,
    /// Weak returns count as nothing.
    Threshold,
    /// A network weighs what is above the threshold.
    Learned,
}

/// Who computes a network.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Provider {
    /// The processor.
    #[default]
    Cpu,
    /// A GPU, by CUDA.
    Cuda,
    /// A GPU, by TensorRT.
    Tensorrt,
    /// What OpenVINO finds.
    Openvino,
}

impl fmt::Display for Provider {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Cuda => "cuda",
            Self::Tensorrt => "tensorrt",
            Self::Openvino => "openvino",
        })
    }
}

/// A setting out of its bounds.
#[derive(Debug, Error, PartialEq)]
pub enum MaskingConfigError {
    /// No threads, or absurdly many.
    #[error("threads is {0}, but must be 1 to 64")]
    Threads(usize),
    /// What no mask is raised to.
    #[error("point_exponent is {0}, but must be 0 to 4")]
    PointExponent(f32),
    /// A scan's own motion is not known yet when it is masked.
    #[error("lag is 0, but a scan's own motion is not known yet: it must be 1 or more")]
    Lag,
}

impl Default for MaskingConfig {
    fn default() -> Self {
        Self {
            kind: MaskKind::Threshold,
            threshold: 60,
            model: None,
            sha256: None,
            runtime: None,
            threads: 1,
            provider: Provider::Cpu,
            point_exponent: 0.5,
            compensate: true,
            lag: 2,
            undo_doppler: false,
            stress_delay_ms: 0,
        }
    }
}

impl MaskingConfig {
    /// Whether scans can be masked so, as far as can be told without reading any file.
    ///
    /// # Errors
    /// The first setting that is out of its bounds.
    pub fn validate(&self) -> Result<(), MaskingConfigError> {
        match () {
            () if !(1..=64).contains(&self.threads) => {
                Err(MaskingConfigError::Threads(self.threads))
            }
            () if !(0.0..=4.0).contains(&self.point_exponent) => {
                Err(MaskingConfigError::PointExponent(self.point_exponent))
            }
            () if self.compensate && self.lag == 0 => Err(MaskingConfigError::Lag),
            () => Ok(()),
        }
    }

    /// Names what a learned mask depends on, so that the same configuration repeats the run from anywhere or is refused: the
    /// model's card and the runtime by absolute paths, and the model's checksum.
    ///
    /// # Errors
    /// A card that cannot be read, ONNX Runtime missing.
    pub fn resolve(&mut self) -> Result<(), NetworkError> {
        if self.kind == MaskKind::Learned {
            self.sha256 = Some(Card::read(self)?.model.sha256);
            self.runtime = Some(runtime::find(self.runtime.as_deref())?);
            self.model = self
                .model
                .take()
                .map(|card| card.canonicalize().unwrap_or(card));
        }
        Ok(())
    }

    /// Power that counts as nothing.
    pub fn floor(&self) -> u8 {
        match self.kind {
            MaskKind::None => 0,
            MaskKind::Threshold | MaskKind::Learned => self.threshold,
        }
    }

    /// The lag of the motions that masking waits for; 0 where it waits for none.
    pub fn feedback_lag(&self) -> usize {
        if self.compensate { self.lag } else { 0 }
    }
}
