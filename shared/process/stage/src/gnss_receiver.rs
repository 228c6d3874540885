//! The fixes of a live GNSS receiver: the received datagrams are appended to a log, and the
//! corrected trajectory uses that log.

use std::{
    io::{self, ErrorKind},
    net::UdpSocket,
    path::Path,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_storage::{File, GroupSync, StorageError};

use crate::datagrams::{MAX_DATAGRAM, TURN_BYTES, dropped, lines, listen, receive};
use gyre_transport::RunError;

const HEADER: &str = "stamp_ns,latitude_deg,longitude_deg,sigma_m\n";
/// The row of a line that is no fix: readers of the log count it.
const UNREADABLE: &str = "unreadable\n";
/// Rows that the log takes in this time: receivers send at most 20 a second.
const MAX_ROWS: usize = 5000;
const OF: Duration = Duration::from_secs(10);
/// Maximum size of the log, bytes: several days of fixes.
const MAX_LOG: u64 = 1 << 30;
const WAIT: Duration = Duration::from_millis(50);

/// Receives fixes in a thread of its own, so that no fix waits while the trajectory is solved, and
/// appends a row for each line of a datagram, in the order of arrival.
pub struct GnssReceiver {
    thread: Option<JoinHandle<Result<(), RunError>>>,
    shared: Arc<Shared>,
    read: Option<u64>,
}

struct Shared {
    ends: AtomicBool,
    /// Datagrams in the log. It is written and read while this is locked.
    datagrams: Mutex<u64>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, u64> {
        self.datagrams
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

impl GnssReceiver {
    /// Receives at an address, and continues the log if there is one.
    pub fn open(address: &str, log: &Path) -> Result<Self, RunError> {
        let socket = listen("fixes of GNSS", "gnss", address)?;
        let log = Log::open(log)?;
        let timeout = socket.set_read_timeout(Some(WAIT));
        timeout.map_err(|error| RunError::transport("receive fixes", error))?;
        let shared = Arc::new(Shared {
            ends: AtomicBool::new(false),
            datagrams: Mutex::new(0),
        });
        let reception = Reception {
            socket,
            log,
            shared: shared.clone(),
            since: Instant::now(),
            rows: 0,
            surplus: 0,
        };
        tracing::info!(address, "waiting for fixes of GNSS");
        let stage = tracing::Span::current();
        Ok(Self {
            thread: Some(thread::spawn(move || stage.in_scope(|| reception.run()))),
            shared,
            read: None,
        })
    }

    /// Returns what `read` makes of the log, which meanwhile does not change; `None` if it has not
    /// grown since the last call.
    pub fn if_grown<T>(&mut self, read: impl FnOnce() -> T) -> Result<Option<T>, RunError> {
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            self.finish()?;
        }
        let datagrams = self.shared.lock();
        let is_read = self.read.replace(*datagrams) == Some(*datagrams);
        Ok((!is_read).then(read))
    }

    /// Takes all received datagrams, and ends reception: the log does not change any more.
    pub fn finish(&mut self) -> Result<(), RunError> {
        self.shared.ends.store(true, Ordering::Relaxed);
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(ended)) => ended,
            Some(Err(_)) => Err(RunError::transport("receive fixes", "the thread has ended")),
        }
    }
}

impl Drop for GnssReceiver {
    fn drop(&mut self) {
        // Who drops it does not need the log.
        let _ = self.finish();
    }
}

struct Log {
    file: File,
    end: u64,
    sync: GroupSync,
}

impl Log {
    /// Opens a log at its end. A row that a kill has cut is ended.
    fn open(path: &Path) -> Result<Self, StorageError> {
        let file = File::open_or_create(path)?;
        let (end, mut last) = (file.length()?, [b'\n']);
        let is_new = end == 0 || !file.read_at(&mut last, end - 1)?;
        let mut log = Self {
            sync: GroupSync::start(&file)?,
            file,
            end,
        };
        match (is_new, last) {
            (true, _) => log.append(HEADER)?,
            (false, [b'\n']) => {}
            (false, _) => log.append("\n")?,
        }
        Ok(log)
    }

    fn append(&mut self, rows: &str) -> Result<(), StorageError> {
        self.file.write_at(rows.as_bytes(), self.end)?;
        self.end += rows.len() as u64;
        Ok(())
    }
}

struct Reception {
    socket: UdpSocket,
    log: Log,
    shared: Arc<Shared>,
    /// Rows since that time, and lines for which the log had no room and which it does not count
    /// yet.
    since: Instant,
    rows: usize,
    surplus: usize,
}

impl Reception {
    fn run(mut self) -> Result<(), RunError> {
        let failed = |error: io::Error| RunError::transport("receive fixes", error);
        let mut datagram = vec![0; MAX_DATAGRAM];
        let mut has_arrived = false;
        self.socket.set_nonblocking(false).map_err(failed)?;
        while !self.shared.ends.load(Ordering::Relaxed) {
            match self.socket.recv(&mut datagram) {
                Ok(bytes) => {
                    self.append(&datagram[..bytes])?;
                    if !std::mem::replace(&mut has_arrived, true) {
                        tracing::info!("fixes of GNSS arrive");
                    }
                }
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted | ErrorKind::WouldBlock | ErrorKind::TimedOut => {}
                    _ => return Err(failed(error)),
                },
            }
        }
        // At the end only the waiting datagrams are read, because a receiver continues to send.
        self.socket.set_nonblocking(true).map_err(failed)?;
        let mut left = TURN_BYTES;
        while let Some(bytes) = receive(&self.socket, &mut datagram, &mut left)? {
            self.append(&datagram[..bytes])?;
        }
        if let lost @ 1.. = dropped(&self.socket) {
            tracing::warn!(lost, "datagrams with fixes came faster than they are read");
        }
        let surplus = self.surplus();
        self.log.append(&surplus)?;
        Ok(self.log.sync.finish()?)
    }

    fn surplus(&mut self) -> String {
        match std::mem::take(&mut self.surplus) {
            0 => String::new(),
            surplus => format!("unreadable,{surplus}\n"),
        }
    }

    fn append(&mut self, datagram: &[u8]) -> Result<(), RunError> {
        let lines = lines(datagram).filter(|line| !line.trim().is_empty());
        let mut rows = String::new();
        if self.since.elapsed() >= OF {
            rows += &self.surplus();
            (self.since, self.rows) = (Instant::now(), 0);
        }
        for line in lines {
            self.rows += 1;
            match self.rows <= MAX_ROWS && self.log.end < MAX_LOG {
                true => rows += row(line).as_deref().unwrap_or(UNREADABLE),
                false => self.surplus += 1,
            }
        }
        let mut datagrams = self.shared.lock();
        self.log.append(&rows)?;
        *datagrams += 1;
        // Readers do not wait for the disk.
        drop(datagrams);
        Ok(self.log.sync.changed()?)
    }
}

/// Returns the row of a line: a stamp, ns, latitude and longitude, degrees (both empty without a
/// fix), and the standard deviation, m, if the receiver knows it. `None`: it is no fix.
fn row(line: &str) -> Option<String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let (stamp, position, sigma_m) = match fields[..] {
        [stamp, latitude, longitude] => (stamp, [latitude, longitude], ""),
        [stamp, latitude, longitude, sigma_m] => (stamp, [latitude, longitude], sigma_m),
        _ => return None,
    };
    let stamp_ns: i64 = stamp.parse().ok()?;
    if position == ["", ""] {
        return Some(format!("{stamp_ns},,,0\n"));
    }
    let sigma_m = if sigma_m.is_empty() { "0" } else { sigma_m };
    let [latitude, longitude] = position;
    let numbers = [latitude, longitude, sigma_m].map(str::parse::<f64>);
    let [Ok(latitude), Ok(longitude), Ok(sigma_m)] = numbers else {
        return None;
    };
    // The shortest text that is read back as the same number.
    Some(format!("{stamp_ns},{latitude},{longitude},{sigma_m}\n"))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_line_becomes_a_row_that_a_log_can_have() {
        for (line, expected) in [
            ("17, 51.75,-1.26 ,0.4", "17,51.75,-1.26,0.4\n"),
            ("17,51.75,-1.26", "17,51.75,-1.26,0\n"),
            ("17,51.75,-1.26,", "17,51.75,-1.26,0\n"),
            ("17,,", "17,,,0\n"),
            ("17,,,3", "17,,,0\n"),
            ("17,nan,1,1", "17,NaN,1,1\n"),
            ("17,51.75", UNREADABLE),
            ("1.5,51.75,-1.26", UNREADABLE),
            ("17,51.75,,1", UNREADABLE),
            ("17,51.75,-1.26,0.4,5", UNREADABLE),
            ("stamp_ns,latitude_deg,longitude_deg", UNREADABLE),
            ("\"17", UNREADABLE),
        ] {
            let row = row(line);
            assert_eq!(row.as_deref().unwrap_or(UNREADABLE), expected, "{line}");
        }
    }

    fn send(address: &str, datagrams: &[&[u8]]) {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        for datagram in datagrams {
            socket.send_to(datagram, address).unwrap();
        }
    }

    /// Returns an address below the ports that the system gives to sockets: no socket of another
    /// test takes the port between two receivers.
    fn free_address() -> String {
        format!("127.0.0.2:{}", 20_000 + std::process::id() % 10_000)
    }

    #[test]
    fn all_that_has_arrived_is_in_the_log_at_the_end_and_the_next_receiver_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("gnss.csv");
        let address = free_address();
        let mut receiver = GnssReceiver::open(&address, &log).unwrap();
        let read = || fs::read_to_string(&log).unwrap();
        assert_eq!(
            receiver.if_grown(read).unwrap().as_deref(),
            Some(HEADER),
            "what an earlier one has left counts too"
        );
        assert_eq!(receiver.if_grown(read).unwrap(), None);
        send(&address, &[b"1,2,3\n2,2,3,4\n\n", b"\xff"]);
        receiver.finish().unwrap();
        let expected = format!("{HEADER}1,2,3,0\n2,2,3,4\n{UNREADABLE}");
        assert_eq!(
            receiver.if_grown(read).unwrap().as_deref(),
            Some(&*expected)
        );
        let mut flooded = GnssReceiver::open(&address, &log).unwrap();
        send(&address, &[b"7\n".repeat(20_000).as_slice()]);
        flooded.finish().unwrap();
        let text = read();
        assert_eq!(text.lines().count(), 4 + MAX_ROWS + 1);
        assert!(text.ends_with("unreadable,15000\n"));
        fs::write(&log, format!("{HEADER}1,2,3,0\n2,2,")).unwrap();
        let mut next = GnssReceiver::open(&address, &log).unwrap();
        send(&address, &[b"3,2,3"]);
        next.finish().unwrap();
        assert_eq!(read(), format!("{HEADER}1,2,3,0\n2,2,\n3,2,3,0\n"));
    }

    #[test]
    fn an_address_that_another_one_has_is_named() {
        let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap().to_string();
        let folder = tempfile::tempdir().unwrap();
        let refused = GnssReceiver::open(&address, &folder.path().join("gnss.csv"));
        let refused = refused.err().unwrap().to_string();
        assert!(refused.contains(&address) && refused.contains("gnss.listen"));
    }
}
