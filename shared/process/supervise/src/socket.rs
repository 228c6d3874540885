//! The supervisor's end of the control socket: takes requests, one for each connection, without
//! waiting for a slow client.

use std::{
    io::{self, Read, Write},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::net::{UnixListener, UnixStream},
    },
    path::Path,
    time::{Duration, Instant},
};

use gyre_contract::control::{Answer, Request, SOCKET};
use gyre_transport::RunError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Time for a client to send its request, and to take the answer. The supervisor does nothing else
/// meanwhile, and clients of this user send it at once.
const LIMIT: Duration = Duration::from_millis(100);
const MAX: usize = 64 << 10;

/// The socket, open to this user alone since it lies in the run's root.
pub(crate) struct ControlSocket(UnixListener);

impl ControlSocket {
    pub fn open(root: &Path) -> Result<Self, RunError> {
        let path = root.join(SOCKET);
        let listener = UnixListener::bind(&path).and_then(|listener| {
            listener.set_nonblocking(true)?;
            Ok(listener)
        });
        match listener {
            Ok(listener) => Ok(Self(listener)),
            Err(source) => Err(RunError::File { path, source }),
        }
    }

    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }

    /// Returns the next request, and where its answer goes. An unreadable request is refused here,
    /// and a request whose client has gone is dropped: the client has been informed that nobody
    /// answers.
    pub fn next(&self) -> Option<(Request, Client)> {
        loop {
            let (stream, _) = self.0.accept().ok()?;
            let Ok(client) = Client::of(stream) else {
                continue;
            };
            match client.request() {
                Ok(_) if client.has_gone() => {}
                Ok(request) => return Some((request, client)),
                Err(error) => client.answer(&Answer::Refused(format!(
                    "the request cannot be read: {error}"
                ))),
            }
        }
    }
}

/// A client that waits for its answer.
pub(crate) struct Client(UnixStream);

impl Client {
    fn of(stream: UnixStream) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_write_timeout(Some(LIMIT))?;
        Ok(Self(stream))
    }

    /// Reads the request, a line. The limit holds for all of it, however slowly it comes.
    fn request(&self) -> io::Result<Request> {
        let deadline = Instant::now() + LIMIT;
        let (mut line, mut buffer) = (Vec::new(), [0; 4096]);
        while line.last() != Some(&b'\n') && line.len() < MAX {
            let rest = deadline.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            self.0.set_read_timeout(Some(rest))?;
            match (&self.0).read(&mut buffer)? {
                0 => break,
                length => line.extend_from_slice(&buffer[..length]),
            }
        }
        Ok(serde_json::from_slice(&line)?)
    }

    /// Returns whether nobody waits for the answer any more.
    pub fn has_gone(&self) -> bool {
        let mut polled = [PollFd::new(&self.0, PollFlags::empty())];
        let polls = poll(&mut polled, Some(&Timespec::default()));
        polls.is_ok() && polled[0].revents().contains(PollFlags::HUP)
    }

    /// Answers and closes the connection. A client that has gone meanwhile does not matter.
    pub fn answer(self, answer: &Answer) {
        if let Ok(mut line) = serde_json::to_string(answer) {
            line.push('\n');
            let _ = (&self.0).write_all(line.as_bytes());
        }
    }
}
