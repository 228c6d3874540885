//! A connection to a radar, made anew when it breaks or falls silent: TCP, or a socket that receives its datagrams.

use std::{
    fmt::Display,
    io::{self, ErrorKind, Read, Write},
    net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, TcpStream, ToSocketAddrs, UdpSocket},
    os::fd::{AsFd, BorrowedFd},
    time::{Duration, Instant},
};

use gyre_colossus::{Request, write_request};
use rustix::net::{AddressFamily, SocketFlags, SocketType, bind, socket_with, sockopt};

use crate::{Address, Settings, messages::Messages};

/// The longest time for an attempt to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// Pauses between attempts to connect: the first, and the longest, to which each doubles.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];
/// Room for datagrams that are not read yet, as far as the system gives it: a scan, should this process be late.
const RECEIVE_BYTES: usize = 4 << 20;

/// What a connection has received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Bytes, which are in the parser.
    Bytes,
    /// It was opened.
    Opened,
    /// Nothing; look again after this time.
    Nothing(Duration),
    /// Nothing, and it was closed, or could not be opened; look again after this time.
    Closed(Duration),
}

/// A connection to a radar.
#[derive(Debug)]
pub struct Connection {
    address: Address,
    silence: Duration,
    link: Option<Link>,
    /// The last azimuth, or the opening.
    heard: Instant,
    /// An azimuth has come since the opening.
    is_heard: bool,
    retry_at: Instant,
    pause: Duration,
    /// Who has sent the last datagram.
    from: Option<SocketAddr>,
    /// The only one whose datagrams are taken.
    sender: Option<SocketAddr>,
    /// Its address also after it has fallen silent, once it has sent a scan: another radar of the same group is at another place.
    radar: Option<IpAddr>,
    /// Connections so far.
    pub opened: u64,
    /// Datagrams of others.
    pub foreign: u64,
}

impl Connection {
    /// A connection that is opened when it is first read from.
    pub fn new(settings: &Settings) -> Self {
        let now = Instant::now();
        Self {
            address: settings.address.clone(),
            silence: settings.silence,
            link: None,
            heard: now,
            is_heard: false,
            retry_at: now,
            pause: PAUSES[0],
            from: None,
            sender: None,
            radar: None,
            opened: 0,
            foreign: 0,
        }
    }

    /// The socket, while it is open.
    pub fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.link.as_ref().map(Link::socket)
    }

    /// Reads what has arrived, or opens the connection; does not wait for bytes.
    pub fn receive(&mut self, messages: &mut Messages) -> Received {
        let Some(link) = &mut self.link else {
            return self.open();
        };
        match link.read(messages.space()) {
            Ok((count, from)) => {
                self.from = from;
                if !self.is_foreign() {
                    messages.filled(count);
                }
                Received::Bytes
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Received::Bytes,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                match self.silence.checked_sub(self.heard.elapsed()) {
                    Some(left) if !left.is_zero() => Received::Nothing(left),
                    _ => {
                        let silence = self.silence;
                        self.close(format_args!("it sent no azimuth for {silence:?}"))
                    }
                }
            }
            Err(error) => self.close(error),
        }
    }

    /// Says that an azimuth has come. Other messages don't count: a radar may go on to say that it is alive, and send no powers.
    pub fn has_heard(&mut self) {
        self.heard = Instant::now();
        self.is_heard = true;
        self.pause = PAUSES[0];
    }

    /// Whether azimuths come.
    pub fn is_heard(&self) -> bool {
        self.is_heard
    }

    /// Takes datagrams of the sender of the last one only.
    pub fn take_sender(&mut self) {
        if self.sender.is_none()
            && let Some(from) = self.from
        {
            tracing::info!("the radar is {from}: datagrams of others are passed over");
            self.sender = Some(from);
        }
    }

    /// Says that a scan has come: no description that somebody sends makes them the radar of the run for good.
    pub fn has_scan(&mut self) {
        self.radar = self.sender.map(|sender| sender.ip()).or(self.radar);
    }

    /// Whether the last datagram is of another than the radar; counts those.
    fn is_foreign(&mut self) -> bool {
        let Some(from) = self.from else {
            return false;
        };
        let is_other = self.sender.is_some_and(|sender| sender != from);
        if !is_other && self.radar.is_none_or(|radar| radar == from.ip()) {
            return false;
        }
        self.foreign += 1;
        if self.foreign.is_power_of_two() {
            let so_far = self.foreign;
            tracing::warn!(
                so_far,
                "datagrams of {from} are passed over: the radar of this run is another; give each radar a group or a port of its own"
            );
        }
        true
    }

    fn open(&mut self) -> Received {
        let left = self.retry_at.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            return Received::Nothing(left);
        }
        let requests = [
            Request::RequestConfiguration,
            Request::StartFft,
            Request::StartHealth,
        ];
        match Link::open(&self.address, &requests) {
            Ok(link) => {
                tracing::info!(address = %self.address, "connected to the radar");
                self.link = Some(link);
                self.heard = Instant::now();
                self.is_heard = false;
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
            address = %self.address,
            "no connection to the radar, trying again in {pause:?}: {reason}"
        );
        self.link = None;
        self.sender = None;
        self.is_heard = false;
        self.retry_at = Instant::now() + pause;
        self.pause = (2 * pause).min(PAUSES[1]);
        Received::Closed(pause)
    }
}

impl Drop for Connection {
    /// The radar has room for few clients: leave properly.
    fn drop(&mut self) {
        if let Some(Link::Tcp(stream)) = &mut self.link {
            let mut bytes = Vec::new();
            write_request(&mut bytes, Request::StopFft);
            // It notices the end of the connection too.
            let _ = stream.write_all(&bytes);
        }
    }
}

/// An open connection, or the socket that receives datagrams.
#[derive(Debug)]
pub enum Link {
    Tcp(TcpStream),
    Udp(UdpSocket),
}

impl Link {
    /// Connects and sends requests, or begins to receive.
    pub fn open(address: &Address, requests: &[Request]) -> io::Result<Self> {
        match address {
            Address::Tcp(address) => connect(address, requests).map(Self::Tcp),
            Address::Udp { to, interface } => join(*to, *interface).map(Self::Udp),
        }
    }

    /// Reads bytes, of datagrams one with its sender; does not wait.
    ///
    /// # Errors
    /// There are none, or the connection has ended.
    pub fn read(&mut self, space: &mut [u8]) -> io::Result<(usize, Option<SocketAddr>)> {
        match self {
            Self::Tcp(stream) => match stream.read(space)? {
                0 => Err(io::Error::new(
                    ErrorKind::UnexpectedEof,
                    "it closed the connection",
                )),
                count => Ok((count, None)),
            },
            Self::Udp(socket) => {
                let (count, from) = socket.recv_from(space)?;
                Ok((count, Some(from)))
            }
        }
    }

    fn socket(&self) -> BorrowedFd<'_> {
        match self {
            Self::Tcp(stream) => stream.as_fd(),
            Self::Udp(socket) => socket.as_fd(),
        }
    }
}

/// Receives what is sent to an address; a group is joined on an interface. Other programs may receive the same.
fn join(to: SocketAddrV4, interface: Ipv4Addr) -> io::Result<UdpSocket> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = socket_with(AddressFamily::INET, SocketType::DGRAM, flags, None)?;
    sockopt::set_socket_reuseaddr(&socket, true)?;
    // The system gives as much of it as it allows.
    sockopt::set_socket_recv_buffer_size(&socket, RECEIVE_BYTES)?;
    bind(&socket, &to)?;
    let socket = UdpSocket::from(socket);
    if to.ip().is_multicast() {
        socket.join_multicast_v4(to.ip(), &interface)?;
    }
    Ok(socket)
}

/// Connects and sends requests.
fn connect(address: &str, requests: &[Request]) -> io::Result<TcpStream> {
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
