use std::path::{Path, PathBuf};

use crate::networks::runtime::{self, RuntimeError};

use crate::{Backend, MaskingConfig, Provider};

#[derive(Clone, Debug, PartialEq)]
pub enum Library {
    OnnxRuntime(PathBuf),
    Rten,
}

impl Library {
    /// Returns the library that computes the networks of a configuration. ONNX Runtime is required
    /// if it is named. If it is neither named nor installed, rten replaces it, but only on the
    /// processor.
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

    pub fn onnx_runtime(&self) -> Option<&Path> {
        match self {
            Self::OnnxRuntime(path) => Some(path),
            Self::Rten => None,
        }
    }

    pub fn backend(&self) -> Backend {
        match self {
            Self::OnnxRuntime(_) => Backend::OnnxRuntime,
            Self::Rten => Backend::Rten,
        }
    }
}
