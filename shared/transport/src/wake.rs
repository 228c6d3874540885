//! Sleep until a publisher notifies, a signal arrives, or the longest wait has passed. The
//! transport can lose a wake-up, rarely (a race between its datagram and its flag). So every wait
//! has a limit after which the queues are read anyway, and a wake-up that was caught so is counted.

use std::{
    cell::{Cell, OnceCell},
    io::Read,
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::UnixStream,
    },
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};
use signal_hook::{consts, low_level::pipe};

use crate::{
    RunError,
    heartbeat::{Activity, HeartbeatWriter},
    transport::Listener,
};

pub use crate::heartbeat::MAX_WAIT;

/// Lets a write beyond the limit of file sizes (`ulimit -f`) fail with an error, which a sentence
/// can report. Without this, a signal ends the process.
pub fn report_file_size_limit() -> Result<(), RunError> {
    signal_hook::flag::register(consts::SIGXFSZ, Arc::default())
        .map(drop)
        .map_err(|error| RunError::transport("install the signal handlers", error))
}

/// Lets SIGTERM, SIGINT and SIGHUP end the process from here on, also where [`Signals`] are
/// installed: for work after which nobody waits for them.
pub fn let_signals_end_the_process() -> Result<(), RunError> {
    let always = Arc::new(AtomicBool::new(true));
    for signal in STOP {
        signal_hook::flag::register_conditional_default(signal, Arc::clone(&always))
            .map_err(|error| RunError::transport("install the signal handlers", error))?;
    }
    Ok(())
}

/// Requests a stop of this process, as SIGTERM does: all its [`Signals`] report it.
pub fn request_stop() -> Result<(), RunError> {
    signal_hook::low_level::raise(consts::SIGTERM)
        .map_err(|error| RunError::transport("request a stop", error))
}

const STOP: [i32; 3] = [consts::SIGTERM, consts::SIGINT, consts::SIGHUP];

#[derive(Debug)]
pub struct Signals {
    stop: UnixStream,
    child: UnixStream,
    /// True from the first request to stop on, whichever wait received it.
    stopped: Cell<bool>,
    /// From when a process has taken its place in a run.
    heartbeat: OnceCell<HeartbeatWriter>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Woken {
    /// SIGTERM, SIGINT or SIGHUP has arrived, now or earlier.
    pub stop: bool,
    /// True if a new reader has notified, or its notification may be lost.
    pub may_have_new_readers: bool,
    pub timed_out: bool,
}

impl Signals {
    /// Installs handlers: from here on SIGTERM, SIGINT, SIGHUP and SIGCHLD wake the process instead
    /// of ending it.
    pub fn install() -> Result<Self, RunError> {
        let failed =
            |error: std::io::Error| RunError::transport("install the signal handlers", error);
        let (stop, stop_end) = UnixStream::pair().map_err(failed)?;
        let (child, child_end) = UnixStream::pair().map_err(failed)?;
        for socket in [&stop, &child] {
            socket.set_nonblocking(true).map_err(failed)?;
        }
        for signal in STOP {
            pipe::register(signal, stop_end.try_clone().map_err(failed)?).map_err(failed)?;
        }
        pipe::register(consts::SIGCHLD, child_end).map_err(failed)?;
        Ok(Self {
            stop,
            child,
            stopped: Cell::new(false),
            heartbeat: OnceCell::new(),
        })
    }

    /// Reports the begin and the end of each wait from here on.
    pub fn report_to(&self, heartbeat: HeartbeatWriter) {
        let _ = self.heartbeat.set(heartbeat);
    }

    /// Sleeps for `limit` or until a signal arrives; true on a request to stop.
    pub fn sleep(&self, limit: Duration) -> Result<bool, RunError> {
        Ok(self.wait(&[], None, limit)?.stop)
    }

    /// Sleeps until a listener is notified, a signal arrives or `limit` has passed, whichever is
    /// first. Consumes the notifications of `data`: read all queues afterwards. A notification of
    /// `handshake` is left for `accept_readers` of the writer, to be called if
    /// [`Woken::may_have_new_readers`].
    pub fn wait(
        &self,
        data: &[&Listener],
        handshake: Option<&Listener>,
        limit: Duration,
    ) -> Result<Woken, RunError> {
        self.wait_or_readable(data, handshake.as_slice(), None, limit)
    }

    /// As [`wait`](Self::wait) with any number of topics that are published, or until one of these
    /// connections has something to read, which it leaves there.
    pub fn wait_or_readable<'fd>(
        &self,
        data: &[&Listener],
        handshakes: &[&Listener],
        connections: impl IntoIterator<Item = BorrowedFd<'fd>>,
        limit: Duration,
    ) -> Result<Woken, RunError> {
        let mut polled = vec![self.stop.as_fd(), self.child.as_fd()];
        polled.extend(data.iter().chain(handshakes).map(|it| it.as_fd()));
        for connection in connections {
            polled.push(connection);
        }
        let mut polled: Vec<_> = polled
            .into_iter()
            .map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN))
            .collect();
        self.beat(Activity::Waits);
        let timed_out = sleep_until_ready(&mut polled, limit);
        self.beat(Activity::Works);
        let timed_out = timed_out?;
        // Read only ready descriptors: each system call saved reduces latency.
        let mut ready = polled.iter().map(|polled| !polled.revents().is_empty());
        let mut next = || ready.next().unwrap_or(false);
        let stop = next() && drain(&self.stop);
        // Who waits for a child looks at it after each wait.
        let _ = next() && drain(&self.child);
        for listener in data {
            if next() {
                listener.take()?;
            }
        }
        self.stopped.set(stop || self.stopped.get());
        Ok(Woken {
            stop: self.stopped.get(),
            may_have_new_readers: handshakes.iter().filter(|_| next()).count() > 0 || timed_out,
            timed_out,
        })
    }

    /// Reports that the work on an item begins, also without a wait before it.
    pub fn work_begins(&self) {
        self.beat(Activity::Works);
    }

    fn beat(&self, activity: Activity) {
        if let Some(heartbeat) = self.heartbeat.get() {
            heartbeat.beat(activity);
        }
    }
}

/// Sleeps until a listener is notified or `limit` has passed, and consumes its notifications.
pub fn wait_for(listener: &Listener, limit: Duration) -> Result<(), RunError> {
    let polled = PollFd::new(listener, PollFlags::IN);
    match sleep_until_ready(&mut [polled], limit)? {
        true => Ok(()),
        false => listener.take().map(drop),
    }
}

/// Sleeps until a descriptor has something to read, or `limit` has passed.
pub fn wait_for_readable(descriptor: &impl AsFd, limit: Duration) -> Result<(), RunError> {
    let polled = PollFd::new(descriptor, PollFlags::IN);
    sleep_until_ready(&mut [polled], limit).map(drop)
}

fn sleep_until_ready(polled: &mut [PollFd<'_>], limit: Duration) -> Result<bool, RunError> {
    let limit = Timespec {
        tv_sec: limit.as_secs() as i64,
        tv_nsec: i64::from(limit.subsec_nanos()),
    };
    match poll(polled, Some(&limit)) {
        Ok(ready) => Ok(ready == 0),
        Err(Errno::INTR) => Ok(false),
        Err(error) => Err(RunError::transport("wait", error)),
    }
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
    use std::io::Write;

    use super::*;

    #[test]
    fn each_connection_wakes_and_a_request_to_stop_persists_over_later_waits() {
        let [(stop, mut signal), (child, _open), one, two] =
            [0; 4].map(|_| UnixStream::pair().unwrap());
        [&stop, &child]
            .iter()
            .for_each(|socket| socket.set_nonblocking(true).unwrap());
        let signals = Signals {
            stop,
            child,
            stopped: Cell::new(false),
            heartbeat: OnceCell::new(),
        };
        let short = Duration::from_millis(1);
        let both = [one.0.as_fd(), two.0.as_fd()];
        (&two.1).write_all(&[0]).unwrap();
        let woken = signals.wait_or_readable(&[], &[], both, Duration::from_secs(600));
        assert!(!woken.unwrap().timed_out);
        assert!(!signals.wait(&[], None, short).unwrap().stop);
        signal.write_all(&[0]).unwrap();
        assert!(signals.wait(&[], None, short).unwrap().stop);
        assert!(signals.wait(&[], None, short).unwrap().stop);
    }
}
