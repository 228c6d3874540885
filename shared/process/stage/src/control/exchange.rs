//! One request to a supervisor and its answer.

use std::{
    io::{self, BufRead, BufReader, Write},
    os::unix::net::UnixStream,
    path::Path,
    time::Duration,
};

use super::Request;

/// A request that was sent. Dropped before its answer, it is given up: the supervisor does not
/// carry out what nobody waits for.
pub(super) struct Sent {
    reader: BufReader<UnixStream>,
    answer: Vec<u8>,
}

impl Sent {
    /// Sends a request to the socket.
    pub fn to(socket: &Path, request: &Request, limit: Duration) -> io::Result<Self> {
        let mut connection = UnixStream::connect(socket)?;
        connection.set_write_timeout(Some(limit))?;
        let mut line = serde_json::to_string(request)?;
        line.push('\n');
        connection.write_all(line.as_bytes())?;
        Ok(Self {
            reader: BufReader::new(connection),
            answer: Vec::new(),
        })
    }

    /// Waits for the answer; `None` if there is none within `limit`.
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
