//! A medium as the sender of a hand-over uses it.

use crate::StressError;

/// A medium as its sender uses it.
pub(super) trait Send {
    /// Waits until all readers are there, after they have said so.
    fn begin(&mut self) -> Result<(), StressError>;

    /// Writes a message anew.
    fn write(&mut self, number: u64) -> Result<(), StressError>;

    /// Sends it.
    fn send(&mut self) -> Result<(), StressError>;

    /// Returns the bytes of shared memory.
    fn shared_bytes(&self) -> u64;
}
