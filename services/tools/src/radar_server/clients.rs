//! The clients of a radar that is played.

use std::{
    io::{self, Read, Write},
    net::{Shutdown, TcpListener, TcpStream},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use gyre_colossus::{Configuration, Event, Message, Parser, Request, write_configuration};

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
                        thread::sleep(PAUSE);
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
