use std::path::PathBuf;

use crate::networks::runtime::{self, RuntimeError};
use crate::{Backend, MaskKind, MaskingConfig, Provider, model::Card, network::NetworkError};

impl MaskingConfig {
    /// Resolves the inputs of a learned mask, so that the stored configuration repeats the run from
    /// any folder or is rejected: the absolute paths of model card and runtime, the checksum of the
    /// model, and the backend.
    pub fn resolve(&mut self) -> Result<(), NetworkError> {
        if self.kind == MaskKind::Learned {
            let card = Card::read(self).map_err(NetworkError::Model)?;
            self.sha256 = Some(card.model.sha256);
            self.resolve_library()?;
            self.model = self
                .model
                .take()
                .map(|card| card.canonicalize().unwrap_or(card));
        }
        Ok(())
    }

    pub fn resolve_library(&mut self) -> Result<(), RuntimeError> {
        self.runtime = self.onnx_runtime()?;
        self.backend = match self.runtime {
            Some(_) => Backend::OnnxRuntime,
            None => Backend::Rten,
        };
        Ok(())
    }

    /// Returns the library of ONNX Runtime that computes the networks; `None` for rten. ONNX
    /// Runtime is required if it is named. If it is neither named nor installed, rten replaces it,
    /// but only on the processor.
    pub fn onnx_runtime(&self) -> Result<Option<PathBuf>, RuntimeError> {
        if self.backend == Backend::Rten {
            return Ok(None);
        }
        let is_required = self.backend == Backend::OnnxRuntime || self.provider != Provider::Cpu;
        match runtime::find(self.runtime.as_deref()) {
            Err(RuntimeError::Missing) if !is_required => Ok(None),
            found => found.map(Some),
        }
    }
}
