//! How a process sleeps: until a neighbour notifies it, a signal comes, or the net's time is up.
//!
//! Nobody polls. The transport can lose a wake-up (rarely: a race between its datagram and its flag), so every wait has a
//! limit after which the queues are looked at all the same; what that net catches is counted.

use std::{
    io::Read,
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    time::Duration,
};

use iceoryx2::prelude::{FileDescriptorBased, ipc};
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};
use signal_hook::{consts, low_level::pipe};

use crate::StageError;

type Listener = iceoryx2::port::listener::Listener<ipc::Service>;

/// The longest sleep.
pub const NET: Duration = Duration::from_millis(200);

/// Signals turned into something to wait for.
#[derive(Debug)]
pub struct Signals {
    stop: UnixStream,
    child: UnixStream,
}

/// What ended a sleep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Woken {
    /// SIGTERM or SIGINT has come.
    pub stop: bool,
    /// A child process has ended.
    pub child: bool,
    /// Nothing came: the limit was reached.
    pub timed_out: bool,
}

impl Signals {
    /// From here on SIGTERM, SIGINT and SIGCHLD wake the process instead of ending it.
    pub fn install() -> Result<Self, StageError> {
        let failed = |error: std::io::Error| StageError::transport("install the signal handlers", error);
        let (stop, stop_end) = UnixStream::pair().map_err(failed)?;
        let (child, child_end) = UnixStream::pair().map_err(failed)?;
        for socket in [&stop, &child] {
            socket.set_nonblocking(true).map_err(failed)?;
        }
        pipe::register(consts::SIGTERM, stop_end.try_clone().map_err(failed)?).map_err(failed)?;
        pipe::register(consts::SIGINT, stop_end).map_err(failed)?;
        pipe::register(consts::SIGCHLD, child_end).map_err(failed)?;
        Ok(Self { stop, child })
    }

    /// Sleeps until one of the listeners is notified, a signal comes or `limit` is over, whichever is first.
    /// The notifications are consumed: look at all queues afterwards.
    pub fn wait(&self, listeners: &[&Listener], limit: Duration) -> Result<Woken, StageError> {
        let mut polled: Vec<PollFd<'_>> = vec![
            PollFd::from_borrowed_fd(self.stop.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.child.as_fd(), PollFlags::IN),
        ];
        polled.extend(listeners.iter().map(|listener| PollFd::from_borrowed_fd(descriptor(listener), PollFlags::IN)));
        let limit = Timespec { tv_sec: limit.as_secs() as i64, tv_nsec: i64::from(limit.subsec_nanos()) };
        let ready = match poll(&mut polled, Some(&limit)) {
            Ok(ready) => ready,
            Err(Errno::INTR) => 1,
            Err(error) => return Err(StageError::transport("wait", error)),
        };
        for listener in listeners {
            listener.try_wait(|_| ()).map_err(|e| StageError::transport("read notifications", e))?;
        }
        Ok(Woken { stop: drain(&self.stop), child: drain(&self.child), timed_out: ready == 0 })
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
