//! The receivers of a playback: clients by TCP, or a group by UDP.

use std::{
    io::{self, Read, Write},
    net::{Shutdown, SocketAddrV4, TcpListener, TcpStream, UdpSocket},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, sleep},
    time::{Duration, Instant},
};

use gyre_colossus::{
    Azimuth, Configuration, Event, Message, Parser, Request,
    asterix::{write_azimuth, write_description},
    write_configuration,
};
use gyre_configuration::terminal::Failure;

use super::{RadarServerArguments, unserved};

/// The longest time between two checks for a request to stop.
const SLICE: Duration = Duration::from_millis(50);
/// Time between two polls for a client.
const POLL: Duration = Duration::from_millis(5);
/// Time between two descriptions of a radar that sends no powers yet.
const DESCRIBE_PERIOD: Duration = Duration::from_millis(100);

pub enum Output {
    /// Clients by TCP, from the first request for azimuths on.
    Clients(Clients),
    /// The receivers of the datagrams, if there are any.
    Group(Group),
}

impl Output {
    /// Returns the receivers, the address for receiving the radar, and whether other machines reach
    /// it.
    pub fn open(
        arguments: &RadarServerArguments,
        radar: &Configuration,
    ) -> Result<(Self, String, bool), Failure> {
        if let Some(to) = arguments.udp {
            if arguments.rate.factor().is_none() {
                return Err("--rate max has no meaning with --udp: the speed at which datagrams are read is unknown; give a factor".into());
            }
            // With an unspecified interface the system chooses it.
            let interface = arguments.interface;
            let group = Group {
                socket: UdpSocket::bind((interface, 0)).map_err(unserved)?,
                to,
                wait: arguments.wait_s,
                number: 0,
                lost: 0,
            };
            let (output, address) = (Self::Group(group), format!("udp://{to}"));
            return Ok((output, address, !interface.is_loopback()));
        }
        let listen = &arguments.listen;
        let listener = TcpListener::bind(listen).map_err(|error| {
            format!("cannot serve at {listen}: {error}; choose another --listen")
        })?;
        let address = listener.local_addr()?;
        let clients = Clients::accept(listener, radar).map_err(unserved)?;
        let is_public = !address.ip().is_loopback();
        Ok((Self::Clients(clients), address.to_string(), is_public))
    }

    /// Describes the radar to a group for the time that was asked for; false on a request to stop.
    pub fn describe(&mut self, radar: &Configuration, stop: &dyn Fn() -> bool) -> bool {
        let Self::Group(group) = self else {
            return true;
        };
        let end = Instant::now() + group.wait;
        while Instant::now() < end {
            group.describe(radar);
            if stop() {
                return false;
            }
            sleep(DESCRIBE_PERIOD);
        }
        true
    }

    /// Waits until a client has asked for azimuths; false on a request to stop.
    pub fn await_client(&self, stop: &dyn Fn() -> bool) -> bool {
        let Self::Clients(clients) = self else {
            return true;
        };
        while !clients.any_started() {
            if stop() {
                return false;
            }
            sleep(POLL);
        }
        true
    }

    /// Sends bytes as they are: a part of a stream, or one datagram.
    pub fn send(&mut self, bytes: &[u8]) {
        match self {
            Self::Clients(clients) => clients.send(bytes),
            Self::Group(group) => group.pass(bytes),
        }
    }

    /// Ends the connections when the clients have read all.
    pub fn close(&self) {
        if let Self::Clients(clients) = self {
            clients.close();
        }
    }
}

/// Sleeps until a time; false on a request to stop. Before a short sleep `stop` is not called: it
/// would take longer than the time between two azimuths.
pub(super) fn sleep_until(due: Instant, stop: &dyn Fn() -> bool) -> bool {
    loop {
        let left = due.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return true;
        }
        if left > SLICE && stop() {
            return false;
        }
        sleep(left.min(SLICE));
    }
}

pub struct Group {
    socket: UdpSocket,
    to: SocketAddrV4,
    /// The time before the first scan, for which only the radar's description is sent.
    wait: Duration,
    number: u32,
    /// Datagrams that this machine could not send.
    pub lost: u64,
}

impl Group {
    /// Sends the radar's description of itself, and no powers.
    pub fn describe(&mut self, radar: &Configuration) {
        let mut datagram = Vec::new();
        write_description(&mut datagram, radar, self.number);
        self.number = self.number.wrapping_add(1);
        self.pass(&datagram);
    }

    /// Sends an azimuth in several datagrams.
    pub fn send(&mut self, radar: &Configuration, azimuth: &Azimuth<'_>) {
        let mut next = self.number;
        write_azimuth(radar, azimuth, &mut next, &mut |datagram| {
            self.pass(datagram);
        });
        self.number = next;
    }

    /// Sends a datagram as it is. Nobody need be there to receive it.
    pub fn pass(&mut self, datagram: &[u8]) {
        if self.socket.send_to(datagram, self.to).is_err() {
            self.lost += 1;
        }
    }
}

const MAX_CLIENTS: usize = 3;
/// Time without a read after which a client is given up.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// Time until the next connection is accepted after one that failed.
const PAUSE: Duration = Duration::from_millis(50);
/// Time for the clients to read the last bytes.
const LINGER: Duration = Duration::from_secs(5);

pub struct Clients {
    all: Arc<Mutex<Vec<Client>>>,
}

struct Client {
    stream: TcpStream,
    /// True once it has asked for azimuths.
    started: Arc<AtomicBool>,
}

impl Client {
    fn has_started(&self) -> bool {
        self.started.load(Ordering::Relaxed)
    }
}

impl Clients {
    /// Accepts clients of this radar, each in a thread of its own, which ends with its connection.
    pub fn accept(listener: TcpListener, radar: &Configuration) -> io::Result<Self> {
        let all: Arc<Mutex<Vec<Client>>> = Arc::default();
        let clients = Arc::clone(&all);
        let mut configuration = Vec::new();
        write_configuration(&mut configuration, radar);
        thread::Builder::new()
            .name("accept".to_owned())
            .spawn(move || {
                for stream in listener.incoming() {
                    // A client that leaves at once or too many open files are no reason to stop.
                    let Ok(stream) = stream else {
                        sleep(PAUSE);
                        continue;
                    };
                    let _ = admit(stream, &configuration, &clients);
                }
            })?;
        Ok(Self { all })
    }

    pub fn any_started(&self) -> bool {
        lock(&self.all).iter().any(Client::has_started)
    }

    /// Sends bytes to the clients that have asked for azimuths, and drops those that fail.
    pub fn send(&self, bytes: &[u8]) {
        lock(&self.all).retain_mut(|client| {
            let takes = !client.has_started() || write_in_time(&mut client.stream, bytes).is_ok();
            if !takes {
                let _ = client.stream.shutdown(Shutdown::Both);
            }
            takes
        });
    }

    pub fn reset(&self) {
        for client in lock(&self.all).drain(..) {
            let _ = client.stream.shutdown(Shutdown::Both);
        }
    }

    /// Ends all connections when the clients have read all sent bytes.
    pub fn close(&self) {
        let clients: Vec<_> = lock(&self.all).drain(..).collect();
        for mut client in clients {
            let _ = client.stream.shutdown(Shutdown::Write);
            let _ = client.stream.set_read_timeout(Some(LINGER));
            let mut rest = [0; 256];
            let began = Instant::now();
            while began.elapsed() < LINGER && matches!(client.stream.read(&mut rest), Ok(1..)) {}
        }
    }
}

/// Writes a message within [`WRITE_TIMEOUT`]. The time-out of the socket starts again with each
/// part that a client reads, and all other clients wait meanwhile.
fn write_in_time(stream: &mut TcpStream, mut bytes: &[u8]) -> io::Result<()> {
    let began = Instant::now();
    while !bytes.is_empty() {
        let written = stream.write(bytes)?;
        if written == 0 || began.elapsed() > WRITE_TIMEOUT {
            return Err(io::ErrorKind::TimedOut.into());
        }
        bytes = &bytes[written..];
    }
    Ok(())
}

/// Sends the configuration to a client, and reads its requests in a thread.
fn admit(
    mut stream: TcpStream,
    configuration: &[u8],
    clients: &Arc<Mutex<Vec<Client>>>,
) -> io::Result<()> {
    if lock(clients).len() >= MAX_CLIENTS {
        return stream.shutdown(Shutdown::Both);
    }
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    stream.write_all(configuration)?;
    let reader = stream.try_clone()?;
    let started = Arc::<AtomicBool>::default();
    lock(clients).push(Client {
        stream,
        started: Arc::clone(&started),
    });
    let clients = Arc::clone(clients);
    thread::Builder::new()
        .name("client".to_owned())
        .spawn(move || {
            requests(reader, &started);
            lock(&clients).retain(|client| !Arc::ptr_eq(&client.started, &started));
        })?;
    Ok(())
}

fn requests(mut stream: TcpStream, started: &AtomicBool) {
    let mut parser = Parser::default();
    while let Ok(count @ 1..) = stream.read(parser.space(256)) {
        parser.filled(count);
        while let Some(event) = parser.next() {
            let Event::Message(Message::Request(request)) = event else {
                continue;
            };
            match request {
                Request::StartFft | Request::StartNonContourFft => {
                    started.store(true, Ordering::Relaxed);
                }
                Request::StopFft => started.store(false, Ordering::Relaxed),
                // A recording has no health.
                Request::RequestConfiguration | Request::StartHealth | Request::StopHealth => {}
            }
        }
    }
}

fn lock(clients: &Mutex<Vec<Client>>) -> MutexGuard<'_, Vec<Client>> {
    clients.lock().unwrap_or_else(PoisonError::into_inner)
}
