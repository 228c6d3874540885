//! A connection to a radar, made anew when it breaks or falls silent.

use std::{
    fmt::Display,
    io::{ErrorKind, Read, Write},
    net::{TcpStream, ToSocketAddrs},
    os::fd::{AsFd, BorrowedFd},
    time::{Duration, Instant},
};

use gyre_colossus::{Parser, Request, write_request};

/// The longest time for an attempt to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// Pauses between attempts to connect: the first, and the longest, to which each doubles.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];
/// Bytes to read at once: some ten azimuths.
const CHUNK: usize = 1 << 16;

/// What a connection has received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Bytes, which are in the parser.
    Bytes,
    /// It was opened.
    Opened,
    /// Nothing; look again after this time.
    Nothing(Duration),
}

/// A connection to a radar.
#[derive(Debug)]
pub struct Connection {
    address: String,
    silence: Duration,
    stream: Option<TcpStream>,
    /// The last byte, or the opening.
    heard: Instant,
    retry_at: Instant,
    pause: Duration,
    /// Connections so far.
    pub opened: u64,
}

impl Connection {
    /// A connection that is opened when it is first read from.
    pub fn new(address: &str, silence: Duration) -> Self {
        let now = Instant::now();
        Self {
            address: address.to_owned(),
            silence,
            stream: None,
            heard: now,
            retry_at: now,
            pause: PAUSES[0],
            opened: 0,
        }
    }

    /// The socket, while it is open.
    pub fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.stream.as_ref().map(AsFd::as_fd)
    }

    /// Reads what has arrived, or opens the connection; does not wait for bytes.
    pub fn receive(&mut self, parser: &mut Parser) -> Received {
        let Some(stream) = &mut self.stream else {
            return self.open(parser);
        };
        match stream.read(parser.space(CHUNK)) {
            Ok(0) => self.close("it closed the connection"),
            Ok(count) => {
                parser.filled(count);
                self.heard = Instant::now();
                self.pause = PAUSES[0];
                Received::Bytes
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Received::Bytes,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                match self.silence.checked_sub(self.heard.elapsed()) {
                    Some(left) if !left.is_zero() => Received::Nothing(left),
                    _ => {
                        let silence = self.silence;
                        self.close(format_args!("it sent nothing for {silence:?}"))
                    }
                }
            }
            Err(error) => self.close(error),
        }
    }

    fn open(&mut self, parser: &mut Parser) -> Received {
        let left = self.retry_at.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            return Received::Nothing(left);
        }
        match connect(
            &self.address,
            &[Request::RequestConfiguration, Request::StartFft],
        ) {
            Ok(stream) => {
                tracing::info!(address = self.address, "connected to the radar");
                *parser = Parser::default();
                self.stream = Some(stream);
                self.heard = Instant::now();
                self.opened += 1;
                Received::Opened
            }
            Err(error) => self.close(error),
        }
    }

    /// Closes it, to be opened anew after a pause.
    pub fn close(&mut self, reason: impl Display) -> Received {
        let pause = self.pause;
        tracing::warn!(
            address = self.address,
            "no connection to the radar, trying again in {pause:?}: {reason}"
        );
        self.stream = None;
        self.retry_at = Instant::now() + pause;
        self.pause = (2 * pause).min(PAUSES[1]);
        Received::Nothing(pause)
    }
}

impl Drop for Connection {
    /// The radar has room for few clients: leave properly.
    fn drop(&mut self) {
        if let Some(stream) = &mut self.stream {
            let mut bytes = Vec::new();
            write_request(&mut bytes, Request::StopFft);
            // It notices the end of the connection too.
            let _ = stream.write_all(&bytes);
        }
    }
}

/// Connects and sends requests.
pub fn connect(address: &str, requests: &[Request]) -> std::io::Result<TcpStream> {
    let mut last = None;
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
            Ok(mut stream) => {
                let mut bytes = Vec::new();
                for request in requests {
                    write_request(&mut bytes, *request);
                }
                stream.set_nodelay(true)?;
                stream.write_all(&bytes)?;
                stream.set_nonblocking(true)?;
                return Ok(stream);
            }
            Err(error) => last = Some(error),
        }
    }
    Err(last.unwrap_or_else(|| ErrorKind::AddrNotAvailable.into()))
}
