use crate::networks::runtime::RuntimeError;

use crate::{Library, MaskKind, MaskingConfig, model::Card, network::NetworkError};

impl MaskingConfig {
    /// Resolves the inputs of a learned mask, so that the stored configuration repeats the run from
    /// any folder or is rejected: the absolute paths of model card and runtime, the checksum of the
    /// model, and the backend.
    pub fn resolve(&mut self) -> Result<(), NetworkError> {
        if self.kind == MaskKind::Learned {
            self.sha256 = Some(Card::read(self)?.model.sha256);
            self.resolve_library()?;
            self.model = self
                .model
                .take()
                .map(|card| card.canonicalize().unwrap_or(card));
        }
        Ok(())
    }

    pub fn resolve_library(&mut self) -> Result<(), RuntimeError> {
        let library = Library::find(self)?;
        self.backend = library.backend();
        self.runtime = match library {
            Library::OnnxRuntime(path) => Some(path),
            Library::Rten => None,
        };
        Ok(())
    }
}
