//! Values that threads share, and that are computed on without the GIL.

use std::{
    process,
    sync::{Mutex, PoisonError},
};

use pyo3::prelude::*;

use crate::errors;

/// A value behind a lock, for the threads of one process.
///
/// A forked process has a copy of the lock, which a thread of its parent may have held, of the
/// threads of ONNX Runtime nothing, and the positions in open files in common with its parent. So
/// it is told to make the value anew.
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
        // A computation that panicked has raised PanicException in its thread; what it left is
        // checked as any other input.
        Ok(py.detach(|| compute(&mut self.value.lock().unwrap_or_else(PoisonError::into_inner))))
    }
}
