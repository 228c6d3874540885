//! Wakes a loop that sleeps on descriptors from a thread of the network.

use std::{
    io::{self, Read, Write},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::Arc,
};

/// The end that sleeps.
#[derive(Debug)]
pub(crate) struct Sleeper {
    socket: UnixStream,
    waker: Waker,
}

/// The ends that wake it.
#[derive(Clone, Debug)]
pub(crate) struct Waker(Arc<UnixStream>);

impl Sleeper {
    /// Creates both ends.
    pub fn new() -> io::Result<Self> {
        let (socket, other) = UnixStream::pair()?;
        socket.set_nonblocking(true)?;
        other.set_nonblocking(true)?;
        Ok(Self {
            socket,
            waker: Waker(Arc::new(other)),
        })
    }

    /// Returns an end that wakes this one.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// Returns what to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    /// Forgets what has woken it: look at all that may have come afterwards.
    pub fn clear(&self) {
        let mut bytes = [0; 64];
        while matches!((&self.socket).read(&mut bytes), Ok(read) if read > 0) {}
    }
}

impl Waker {
    /// Wakes the other end. A full socket wakes it too.
    pub fn wake(&self) {
        let _ = (&*self.0).write(&[1]);
    }
}
