//! The library that computes the networks.

use std::{fmt, path::PathBuf};

use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error as _, IntoDeserializer},
};

use crate::{
    MaskingConfig, Provider,
    runtime::{self, RuntimeError},
};

/// The library that computes a network.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// ONNX Runtime where it is found, else rten.
    #[default]
    Auto,
    /// ONNX Runtime, which is opened at run time.
    OnnxRuntime,
    /// rten, which is built in: pure Rust, and slower.
    Rten,
}

impl Backend {
    /// The name of the library.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "ONNX Runtime or rten",
            Self::OnnxRuntime => "ONNX Runtime",
            Self::Rten => "rten",
        }
    }
}

impl fmt::Display for Backend {
    /// The value in configurations.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::OnnxRuntime => "onnxruntime",
            Self::Rten => "rten",
        })
    }
}

/// The library that a configuration chooses on this machine.
#[derive(Clone, Debug, PartialEq)]
pub enum Library {
    /// ONNX Runtime, with the path of its library.
    OnnxRuntime(PathBuf),
    /// rten.
    Rten,
}

impl Library {
    /// Returns the library that computes the networks of a configuration. ONNX Runtime that is
    /// named is required: only where none is named or installed, rten stands in for it, and only on
    /// the processor.
    ///
    /// # Errors
    /// ONNX Runtime is required and missing.
    pub fn find(config: &MaskingConfig) -> Result<Self, RuntimeError> {
        if config.backend == Backend::Rten {
            return Ok(Self::Rten);
        }
        let is_required =
            config.backend == Backend::OnnxRuntime || config.provider != Provider::Cpu;
        match runtime::find(config.runtime.as_deref()) {
            Err(RuntimeError::Missing) if !is_required => Ok(Self::Rten),
            found => Ok(Self::OnnxRuntime(found?)),
        }
    }

    /// Returns the backend.
    pub fn backend(&self) -> Backend {
        match self {
            Self::OnnxRuntime(_) => Backend::OnnxRuntime,
            Self::Rten => Backend::Rten,
        }
    }
}

/// Reads a backend of a configuration.
///
/// # Errors
/// No backend, or one that earlier versions had.
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
