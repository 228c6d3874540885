//! The settings of what computes a network: the library, and the execution provider.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The library that computes a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// ONNX Runtime where it is found, else rten.
    #[default]
    Auto,
    /// ONNX Runtime, which is opened at run time.
    OnnxRuntime,
    /// rten, which is built in.
    Rten,
}

impl Backend {
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "ONNX Runtime or rten",
            Self::OnnxRuntime => "ONNX Runtime",
            Self::Rten => "rten",
        }
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The execution provider of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Provider {
    /// The processor.
    #[default]
    Cpu,
    /// A GPU, by CUDA.
    Cuda,
    /// A GPU, by TensorRT.
    Tensorrt,
    /// The device that OpenVINO selects.
    Openvino,
}

impl fmt::Display for Provider {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}
