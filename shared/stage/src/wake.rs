//! How a process sleeps: until a neighbour notifies it, a signal comes, or the net's time is up.
//!
//! Nobody polls. The transport can lose a wake-up (rarely: a race between its datagram and its flag), so every wait has a
//! limit after which the queues are looked at all the same; what that net catches is counted.

use std::{
    cell::Cell,
    io::Read,
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    time::Duration,
};

use iceoryx2::prelude::FileDescriptorBased;
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};
use signal_hook::{consts, low_level::pipe};

use crate::{StageError, services::Listener};

/// The longest sleep.
pub const MAX_WAIT: Duration = Duration::from_millis(200);

/// Signals turned into something to wait for.
#[derive(Debug)]
pub struct Signals {
    stop: UnixStream,
    child: UnixStream,
    /// A request to stop is never forgotten, whoever slept when it came.
    stopped: Cell<bool>,
}

/// What ended a sleep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Woken {
    /// SIGTERM, SIGINT or SIGHUP has come, now or earlier.
    pub stop: bool,
    /// A child process has ended.
    pub child: bool,
    /// A reader has opened the topic.
    pub handshake: bool,
    /// Nothing came: the limit was reached.
    pub timed_out: bool,
}

impl Woken {
    /// Whether readers may have come: one has notified us, or its notification may have been lost.
    pub fn may_have_new_readers(&self) -> bool {
        self.handshake || self.timed_out
    }
}

impl Signals {
    /// From here on SIGTERM, SIGINT, SIGHUP and SIGCHLD wake the process instead of ending it.
    pub fn install() -> Result<Self, StageError> {
        let failed =
            |error: std::io::Error| StageError::transport("install the signal handlers", error);
        let (stop, stop_end) = UnixStream::pair().map_err(failed)?;
        let (child, child_end) = UnixStream::pair().map_err(failed)?;
        for socket in [&stop, &child] {
            socket.set_nonblocking(true).map_err(failed)?;
        }
        for signal in [consts::SIGTERM, consts::SIGINT, consts::SIGHUP] {
            pipe::register(signal, stop_end.try_clone().map_err(failed)?).map_err(failed)?;
        }
        pipe::register(consts::SIGCHLD, child_end).map_err(failed)?;
        Ok(Self {
            stop,
            child,
            stopped: Cell::new(false),
        })
    }

    /// Sleeps until one of the listeners is notified, a signal comes or `limit` is over, whichever is first.
    /// The notifications of `data` are consumed: look at all queues afterwards. A notification of `handshake` is left for
    /// [`Writer::accept_readers`](crate::writer::Writer::accept_readers), to be called when [`Woken::may_have_new_readers`] says so.
    pub(crate) fn wait(
        &self,
        data: &[&Listener],
        handshake: Option<&Listener>,
        limit: Duration,
    ) -> Result<Woken, StageError> {
        let mut polled = vec![self.stop.as_fd(), self.child.as_fd()];
        polled.extend(data.iter().copied().chain(handshake).map(descriptor));
        let mut polled: Vec<_> = polled
            .into_iter()
            .map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN))
            .collect();
        let limit = Timespec {
            tv_sec: limit.as_secs() as i64,
            tv_nsec: i64::from(limit.subsec_nanos()),
        };
        let timed_out = match poll(&mut polled, Some(&limit)) {
            Ok(ready) => ready == 0,
            Err(Errno::INTR) => false,
            Err(error) => return Err(StageError::transport("wait", error)),
        };
        // Only what is ready is read: each call less is a message taken sooner.
        let mut ready = polled.iter().map(|polled| !polled.revents().is_empty());
        let mut next = || ready.next().unwrap_or(false);
        let (stop, child) = (next() && drain(&self.stop), next() && drain(&self.child));
        for listener in data {
            if next() {
                listener
                    .try_wait(|_| ())
                    .map_err(|e| StageError::transport("read notifications", e))?;
            }
        }
        self.stopped.set(stop || self.stopped.get());
        Ok(Woken {
            stop: self.stopped.get(),
            child,
            handshake: next(),
            timed_out,
        })
    }
}

fn descriptor(listener: &Listener) -> BorrowedFd<'_> {
    // SAFETY: the listener owns the descriptor and outlives the borrow, whose lifetime is the listener's.
    unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) }
}

fn drain(mut socket: &UnixStream) -> bool {
    let mut bytes = [0; 64];
    let mut any = false;
    while matches!(socket.read(&mut bytes), Ok(read) if read > 0) {
        any = true;
    }
    any
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write;

    use super::*;

    #[test]
    fn a_request_to_stop_is_not_forgotten_by_the_next_sleep() {
        let (stop, mut signal) = UnixStream::pair().unwrap();
        let (child, _open) = UnixStream::pair().unwrap();
        [&stop, &child]
            .iter()
            .for_each(|socket| socket.set_nonblocking(true).unwrap());
        let signals = Signals {
            stop,
            child,
            stopped: Cell::new(false),
        };
        let short = Duration::from_millis(1);
        assert!(!signals.wait(&[], None, short).unwrap().stop);
        signal.write_all(&[0]).unwrap();
        assert!(signals.wait(&[], None, short).unwrap().stop);
        assert!(signals.wait(&[], None, short).unwrap().stop);
    }
}
