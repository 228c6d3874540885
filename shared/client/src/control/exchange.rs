//! One request to a supervisor and its answer.

use std::{
    io::{self, BufRead, BufReader, Write},
    os::unix::net::UnixStream,
    path::Path,
    time::{Duration, Instant},
};

use gyre_contract::control::Request;

/// A request that was sent. Dropped before its answer, it is given up: the supervisor does not
/// carry out what nobody waits for.
pub(super) struct Sent {
    reader: BufReader<UnixStream>,
    answer: Vec<u8>,
}

impl Sent {
    pub fn to(socket: &Path, request: &Request, limit: Duration) -> io::Result<Self> {
        let mut line = serde_json::to_string(request)?;
        line.push('\n');
        let connection = write(|| UnixStream::connect(socket), line.as_bytes(), limit)?;
        Ok(Self {
            reader: BufReader::new(connection),
            answer: Vec::new(),
        })
    }

    /// Waits for the answer; `None` without an answer within `limit`.
    pub fn answer(&mut self, limit: Duration) -> io::Result<Option<String>> {
        self.reader.get_ref().set_read_timeout(Some(limit))?;
        match self.reader.read_until(b'\n', &mut self.answer) {
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                ) =>
            {
                Ok(None)
            }
            Err(error) => Err(error),
            Ok(_) if self.answer.is_empty() => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(_) => Ok(Some(String::from_utf8_lossy(&self.answer).into_owned())),
        }
    }
}

/// Writes a request to a new connection, and again while the supervisor closes it unread: a process
/// that the system does not run between the two comes too late for it. Nothing is done twice.
fn write(
    connect: impl Fn() -> io::Result<UnixStream>,
    request: &[u8],
    limit: Duration,
) -> io::Result<UnixStream> {
    let deadline = Instant::now() + limit;
    loop {
        let mut connection = connect()?;
        connection.set_write_timeout(Some(limit))?;
        match connection.write_all(request) {
            Err(error)
                if error.kind() == io::ErrorKind::BrokenPipe && Instant::now() < deadline => {}
            written => return written.map(|()| connection),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{cell::RefCell, io::Read, net::Shutdown};

    #[test]
    fn a_request_is_written_again_where_the_supervisor_no_longer_waited() {
        let (late, _) = UnixStream::pair().unwrap();
        let (in_time, mut supervisor) = UnixStream::pair().unwrap();
        let connections = RefCell::new(vec![in_time, late]);
        let connect = || Ok(connections.borrow_mut().pop().unwrap());
        let limit = Duration::from_secs(10);
        let written = write(connect, b"\"status\"\n", limit).unwrap();
        written.shutdown(Shutdown::Write).unwrap();
        let mut request = String::new();
        supervisor.read_to_string(&mut request).unwrap();
        assert_eq!(request, "\"status\"\n");
    }
}
