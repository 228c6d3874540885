//! The library that computes the networks.

use std::{fmt, path::PathBuf};

use serde::{Deserialize, Serialize};

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
    /// ONNX Runtime where it is found, else tract.
    #[default]
    Auto,
    /// ONNX Runtime, which is opened at run time.
    OnnxRuntime,
    /// tract, which is built in: pure Rust, and slower.
    Tract,
}

impl Backend {
    /// The name of the library.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "ONNX Runtime or tract",
            Self::OnnxRuntime => "ONNX Runtime",
            Self::Tract => "tract",
        }
    }
}

impl fmt::Display for Backend {
    /// The value in configurations.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::OnnxRuntime => "onnxruntime",
            Self::Tract => "tract",
        })
    }
}

/// The library that a configuration chooses on this machine.
#[derive(Clone, Debug, PartialEq)]
pub enum Library {
    /// ONNX Runtime, with the path of its library.
    OnnxRuntime(PathBuf),
    /// tract.
    Tract,
}

impl Library {
    /// Returns the library that computes the networks of a configuration. ONNX Runtime that is named is required: only where none
    /// is named or installed, tract stands in for it, and only on the processor.
    ///
    /// # Errors
    /// ONNX Runtime is required and missing.
    pub fn find(config: &MaskingConfig) -> Result<Self, RuntimeError> {
        if config.backend == Backend::Tract {
            return Ok(Self::Tract);
        }
        let is_required =
            config.backend == Backend::OnnxRuntime || config.provider != Provider::Cpu;
        match runtime::find(config.runtime.as_deref()) {
            Err(RuntimeError::Missing) if !is_required => Ok(Self::Tract),
            found => Ok(Self::OnnxRuntime(found?)),
        }
    }

    /// Returns the backend.
    pub fn backend(&self) -> Backend {
        match self {
            Self::OnnxRuntime(_) => Backend::OnnxRuntime,
            Self::Tract => Backend::Tract,
        }
    }
}
