//! Values that threads share, and that are computed on without the GIL.

use std::{
    process,
    sync::{Mutex, PoisonError},
};

use pyo3::prelude::*;

use crate::errors;

/// A value behind a lock, for the threads of one process.
///
/// A forked process has a copy of the lock, which a thread of its parent may have held. The threads
/// of ONNX Runtime are missing, and the parent shares the positions in open files. So a caller in a
/// forked process must make the value again.
pub struct Guarded<T> {
    name: &'static str,
    process: u32,
    value: Mutex<T>,
}

impl<T: Send> Guarded<T> {
    /// Guards a value that Python knows by this name.
    pub fn new(name: &'static str, value: T) -> Self {
        Self {
            name,
            process: process::id(),
            value: Mutex::new(value),
        }
    }

    /// Computes on the value. The GIL is released first, so that a thread that waits blocks no
    /// other.
    pub fn with<R: Send>(
        &self,
        py: Python<'_>,
        compute: impl FnOnce(&mut T) -> R + Send,
    ) -> PyResult<R> {
        if self.process != process::id() {
            return Err(errors::other(format!(
                "this {} was made before the process forked, and cannot be used in the new one: make it there",
                self.name
            )));
        }
        // A computation that panicked has raised PanicException in its thread, and the values that
        // remain are checked like any other input.
        Ok(py.detach(|| compute(&mut self.value.lock().unwrap_or_else(PoisonError::into_inner))))
    }
}
