//! A result that several tests read.

use std::sync::{Arc, Mutex, Weak};

/// A value that is made for the first test that asks for it, and for all that ask while one of them
/// has it. Its files on the disk are removed with the last user; a `static` value would leave them.
pub struct Shared<T>(Mutex<Weak<T>>);

impl<T> Shared<T> {
    pub const fn new() -> Self {
        Self(Mutex::new(Weak::new()))
    }

    /// Returns the value, and makes it if need be; others who ask meanwhile wait for it.
    pub fn get(&self, make: impl FnOnce() -> T) -> Arc<T> {
        let mut held = self.0.lock().unwrap();
        held.upgrade().unwrap_or_else(|| {
            let made = Arc::new(make());
            *held = Arc::downgrade(&made);
            made
        })
    }
}
