//! The settings of what computes a network: the library, and the execution provider.

use std::fmt;

use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error as _, IntoDeserializer},
};

/// The library that computes a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// ONNX Runtime where it is found, else rten.
    #[default]
    Auto,
    /// ONNX Runtime, which is opened at run time.
    OnnxRuntime,
    /// The built-in ones: rten, or for 8-bit integers Gyre itself.
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

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(source: D) -> Result<Backend, D::Error> {
    let name = String::deserialize(source)?;
    if name == "tract" {
        return Err(D::Error::custom(
            "tract is no longer part of Gyre: rten is built in instead and computes other last digits; \
             set masking.backend to `rten`, or leave it out",
        ));
    }
    Backend::deserialize(name.into_deserializer())
}
