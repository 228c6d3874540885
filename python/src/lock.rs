//! Locks that are taken without the GIL.

use std::sync::{Mutex, PoisonError};

use pyo3::Python;

/// Computes on what a lock protects. The GIL is released first, so that a thread that waits blocks no other.
pub fn with<T: Send, R: Send>(
    py: Python<'_>,
    lock: &Mutex<T>,
    compute: impl FnOnce(&mut T) -> R + Send,
) -> R {
    // A computation that panicked has raised PanicException in its thread; what it left is checked as any other input.
    py.detach(|| compute(&mut lock.lock().unwrap_or_else(PoisonError::into_inner)))
}
