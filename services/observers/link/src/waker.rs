//! Wakes a loop that sleeps on descriptors from a thread of the network.

use std::{
    io::{Read, Write},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::Arc,
};

use crate::LinkError;

/// Two connected sockets: a byte in one makes the other readable. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct Waker(Arc<[UnixStream; 2]>);

impl Waker {
    pub fn new() -> Result<Self, LinkError> {
        let open = || {
            let (sleeping, waking) = UnixStream::pair()?;
            sleeping.set_nonblocking(true)?;
            waking.set_nonblocking(true)?;
            Ok([sleeping, waking])
        };
        let sockets = open().map_err(|e: std::io::Error| LinkError::zenoh("make a socket", &e))?;
        Ok(Self(Arc::new(sockets)))
    }

    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.0[0].as_fd()
    }

    /// Makes the descriptor unreadable: process all that has arrived after this call.
    pub fn clear(&self) {
        let mut bytes = [0; 64];
        while matches!((&self.0[0]).read(&mut bytes), Ok(read) if read > 0) {}
    }

    /// Wakes the loop. A full socket wakes it too.
    pub fn wake(&self) {
        let _ = (&self.0[1]).write(&[1]);
    }
}
