//! Wakes a loop that sleeps on descriptors from a thread of the network.

use std::{
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    sync::Arc,
};

use gyre_client::RunError;
use rustix::{
    event::{EventfdFlags, eventfd},
    io::{read, write},
};

use crate::error::failed;

/// A descriptor that is readable from a call of [`wake`](Self::wake) to the next of
/// [`clear`](Self::clear). Clones share it.
#[derive(Clone, Debug)]
pub(crate) struct Waker(Arc<OwnedFd>);

impl Waker {
    pub fn new() -> Result<Self, RunError> {
        let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK);
        let event = event.map_err(|e| failed("make an event", &e))?;
        Ok(Self(Arc::new(event)))
    }

    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }

    /// Makes the descriptor unreadable: process all that has arrived after this call.
    pub fn clear(&self) {
        let _ = read(self.descriptor(), &mut [0_u8; 8]);
    }

    pub fn wake(&self) {
        let _ = write(self.descriptor(), &1_u64.to_ne_bytes());
    }
}
