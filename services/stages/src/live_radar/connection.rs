//! A connection to a radar, opened again when it breaks or falls silent: TCP, or a socket that
//! receives its datagrams.

use std::{
    fmt::Display,
    io::{self, ErrorKind, Read, Write},
    net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, TcpStream, ToSocketAddrs, UdpSocket},
    os::fd::{AsFd, BorrowedFd},
    time::{Duration, Instant},
};

use gyre_colossus::{Address, Datagrams, Event, Parser, Request, write_request};
use rustix::net::{AddressFamily, SocketFlags, SocketType, bind, socket_with, sockopt};

use crate::live_radar::Settings;

const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// Time between two lines of the log about a radar that stays away.
const LOG_EVERY: Duration = Duration::from_secs(60);
/// Pauses between attempts to connect: the first pause, which doubles up to the second.
const RETRY_PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];
const REQUESTS: [Request; 3] = [
    Request::RequestConfiguration,
    Request::StartFft,
    Request::StartHealth,
];
/// Bytes of other messages, more than wait for a stage that was held up, after which a radar that
/// sends no azimuths is left although it never falls silent.
const OTHER_BYTES: usize = 16 << 20;
/// Buffer for datagrams that are not read yet, as far as the system allows: one scan.
const RECEIVE_BYTES: usize = 4 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadResult {
    Bytes,
    Opened,
    /// Nothing was read; try again after this time.
    Nothing(Duration),
    /// The connection was closed, or could not be opened; try again after this time.
    Closed(Duration),
}

#[derive(Debug)]
pub struct Connection {
    address: Address,
    silence: Duration,
    socket: Option<RadarSocket>,
    /// The time of the last azimuth, or of the opening.
    last_azimuth: Instant,
    /// Bytes received since then.
    without_azimuth: usize,
    /// True from the first azimuth after the opening on.
    pub receives_azimuths: bool,
    retry_at: Instant,
    pause: Duration,
    logged: Option<Instant>,
    from: Option<SocketAddr>,
    /// The only sender whose datagrams are taken.
    sender: Option<SocketAddr>,
    /// The address of the radar once it has sent a scan, kept while it is silent: another radar of
    /// the same group has another address.
    radar: Option<IpAddr>,
    pub opened: u64,
    pub foreign: u64,
}

impl Connection {
    pub fn new(settings: &Settings) -> Self {
        let now = Instant::now();
        Self {
            address: settings.address.clone(),
            silence: settings.silence,
            socket: None,
            last_azimuth: now,
            without_azimuth: 0,
            receives_azimuths: false,
            retry_at: now,
            pause: RETRY_PAUSES[0],
            logged: None,
            from: None,
            sender: None,
            radar: None,
            opened: 0,
            foreign: 0,
        }
    }

    pub fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.socket.as_ref().map(RadarSocket::as_fd)
    }

    /// Reads the bytes that have arrived, or opens the connection; does not wait for bytes.
    pub fn receive(&mut self, messages: &mut RadarParser) -> ReadResult {
        let Some(socket) = &mut self.socket else {
            return self.open();
        };
        match socket.read(messages.space()) {
            Ok((count, from)) => {
                self.from = from;
                if !self.is_foreign() {
                    messages.filled(count);
                    self.without_azimuth += count;
                }
                let floods = self.without_azimuth > OTHER_BYTES;
                match floods && self.last_azimuth.elapsed() > self.silence {
                    true => self.close_deaf(),
                    false => ReadResult::Bytes,
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => ReadResult::Bytes,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                match self.silence.checked_sub(self.last_azimuth.elapsed()) {
                    Some(left) if !left.is_zero() => ReadResult::Nothing(left),
                    _ => self.close_deaf(),
                }
            }
            Err(error) => self.close(error),
        }
    }

    /// Notes that an azimuth has arrived. Other messages do not count: a radar may send keep-alives
    /// without powers.
    pub fn note_azimuth(&mut self) {
        self.last_azimuth = Instant::now();
        self.without_azimuth = 0;
        self.receives_azimuths = true;
        self.pause = RETRY_PAUSES[0];
    }

    /// Takes from now on only datagrams of the sender of the last one.
    pub fn lock_sender(&mut self) {
        if self.sender.is_none()
            && let Some(from) = self.from
        {
            tracing::info!("the radar is {from}: datagrams of others are passed over");
            self.sender = Some(from);
        }
    }

    /// Notes a scan: its sender is the radar of the run. Anybody can send a description.
    pub fn note_scan(&mut self) {
        self.radar = self.sender.map(|sender| sender.ip()).or(self.radar);
    }

    /// Returns whether the last datagram is of another sender than the radar, and counts it.
    fn is_foreign(&mut self) -> bool {
        let Some(from) = self.from else {
            return false;
        };
        let is_known = self.sender.is_none_or(|sender| sender == from);
        if is_known && self.radar.is_none_or(|radar| radar == from.ip()) {
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

    fn open(&mut self) -> ReadResult {
        let left = self.retry_at.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            return ReadResult::Nothing(left);
        }
        match RadarSocket::open(&self.address, &REQUESTS) {
            Ok(socket) => {
                tracing::info!(address = %self.address, "connected to the radar");
                self.socket = Some(socket);
                self.last_azimuth = Instant::now();
                self.without_azimuth = 0;
                self.receives_azimuths = false;
                self.opened += 1;
                ReadResult::Opened
            }
            Err(error) => self.close(error),
        }
    }

    fn close_deaf(&mut self) -> ReadResult {
        let silence = self.silence;
        self.close(format_args!("it sent no azimuth for {silence:?}"))
    }

    /// Closes the connection, to be opened again after a pause.
    pub fn close(&mut self, reason: impl Display) -> ReadResult {
        let pause = self.pause;
        let is_longest = pause == RETRY_PAUSES[1];
        if !is_longest || self.logged.is_none_or(|it| it.elapsed() >= LOG_EVERY) {
            self.logged = Some(Instant::now());
            tracing::warn!(
                address = %self.address,
                "no connection to the radar, trying again in {pause:?}: {reason}"
            );
        }
        self.socket = None;
        self.sender = None;
        self.receives_azimuths = false;
        self.retry_at = Instant::now() + pause;
        self.pause = (2 * pause).min(RETRY_PAUSES[1]);
        ReadResult::Closed(pause)
    }
}

impl Drop for Connection {
    /// Stops the azimuths: the radar has room for few clients.
    fn drop(&mut self) {
        if let Some(RadarSocket::Tcp(stream)) = &mut self.socket {
            let mut bytes = Vec::new();
            write_request(&mut bytes, Request::StopFft);
            // The radar notices the end of the connection too.
            let _ = stream.write_all(&bytes);
        }
    }
}

#[derive(Debug)]
pub enum RadarSocket {
    Tcp(TcpStream),
    Udp(UdpSocket),
}

impl RadarSocket {
    pub fn open(address: &Address, requests: &[Request]) -> io::Result<Self> {
        match address {
            Address::Tcp(address) => connect(address, requests).map(Self::Tcp),
            Address::Udp { to, interface } => join(*to, *interface).map(Self::Udp),
        }
    }

    /// Reads bytes of a stream, or one datagram with its sender; does not wait.
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

    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Tcp(stream) => stream.as_fd(),
            Self::Udp(socket) => socket.as_fd(),
        }
    }
}

/// Opens a socket for datagrams to an address; joins a group on an interface. Other programs may
/// receive the same datagrams.
fn join(to: SocketAddrV4, interface: Ipv4Addr) -> io::Result<UdpSocket> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = socket_with(AddressFamily::INET, SocketType::DGRAM, flags, None)?;
    sockopt::set_socket_reuseaddr(&socket, true)?;
    // The system may allow less.
    sockopt::set_socket_recv_buffer_size(&socket, RECEIVE_BYTES)?;
    bind(&socket, &to)?;
    let socket = UdpSocket::from(socket);
    if to.ip().is_multicast() {
        socket.join_multicast_v4(to.ip(), &interface)?;
    }
    Ok(socket)
}

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

/// Bytes to read of a stream at once: some ten azimuths.
const CHUNK: usize = 1 << 16;

#[derive(Debug)]
pub enum RadarParser {
    Stream(Parser),
    Datagrams(Datagrams),
}

impl RadarParser {
    /// `encoder_counts` per turn: for a radar that does not report them.
    pub fn new(is_udp: bool, encoder_counts: u16) -> Self {
        match is_udp {
            false => Self::Stream(Parser::default()),
            true => Self::Datagrams(Datagrams::new(encoder_counts)),
        }
    }

    pub fn space(&mut self) -> &mut [u8] {
        match self {
            Self::Stream(parser) => parser.space(CHUNK),
            Self::Datagrams(parser) => parser.space(),
        }
    }

    pub fn filled(&mut self, bytes: usize) {
        match self {
            Self::Stream(parser) => parser.filled(bytes),
            Self::Datagrams(parser) => parser.filled(bytes),
        }
    }

    pub fn next(&mut self) -> Option<Event<'_>> {
        match self {
            Self::Stream(parser) => parser.next(),
            Self::Datagrams(parser) => parser.next(),
        }
    }

    /// Discards the radar's description that was returned last, and the datagram that has it.
    pub fn refuse_description(&mut self) {
        if let Self::Datagrams(parser) = self {
            parser.refuse_description();
        }
    }

    /// Returns whether a part of an azimuth has arrived in a datagram since the last call.
    pub fn take_part(&mut self) -> bool {
        match self {
            Self::Stream(_) => false,
            Self::Datagrams(parser) => parser.take_part(),
        }
    }

    /// Returns the bytes of a stream since the last event: they grow while it is not Colossus.
    pub fn skipped_bytes(&self) -> usize {
        match self {
            Self::Stream(parser) => parser.skipped_bytes(),
            Self::Datagrams(_) => 0,
        }
    }
}
