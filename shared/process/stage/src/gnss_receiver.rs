//! The fixes of a live GNSS receiver: the received datagrams are appended to a log, and the
//! corrected trajectory uses that log.

use std::{
    mem,
    path::Path,
    time::{Duration, Instant},
};

use gyre_geometry::samples::SensorConfig;
use gyre_storage::{File, GroupSync, StorageError};

use crate::datagrams::Receiver;
use gyre_transport::RunError;

const HEADER: &str = "stamp_ns,latitude_deg,longitude_deg,sigma_m\n";
/// The row of a line that is no fix: readers of the log count it.
const UNREADABLE: &str = "unreadable\n";
/// Rows that the log takes in this time: receivers send at most 20 a second.
const MAX_ROWS: usize = 5000;
const OF: Duration = Duration::from_secs(10);
/// Maximum size of the log, bytes: several days of fixes.
const MAX_LOG: u64 = 1 << 30;

/// Receives fixes, and appends a row for each line of a datagram, in the order of arrival. The
/// socket holds the fixes of ten seconds while nobody asks for them.
pub struct GnssReceiver {
    receiver: Receiver,
    log: Log,
    /// Rows since that time, and lines for which the log had no room and which it does not count
    /// yet.
    since: Instant,
    rows: usize,
    surplus: usize,
    has_arrived: bool,
    has_ended: bool,
}

impl GnssReceiver {
    /// Receives at the address of the section, and continues the log if there is one.
    pub fn open(sensor: &dyn SensorConfig, log: &Path) -> Result<Self, RunError> {
        let receiver = Receiver::open(sensor)?;
        let (log, address) = (Log::open(log)?, sensor.listen());
        tracing::info!(address, "waiting for fixes of GNSS");
        Ok(Self {
            receiver,
            log,
            since: Instant::now(),
            rows: 0,
            surplus: 0,
            has_arrived: false,
            has_ended: false,
        })
    }

    /// Appends the fixes that have arrived, at most one turn of them.
    pub fn receive(&mut self) -> Result<(), RunError> {
        if self.has_ended {
            return Ok(());
        }
        let mut rows = String::new();
        if self.since.elapsed() >= OF {
            rows += &self.surplus();
            (self.since, self.rows) = (Instant::now(), 0);
        }
        let (mut has_arrived, mut room) = (false, MAX_ROWS.saturating_sub(self.rows));
        if self.log.end >= MAX_LOG {
            room = 0;
        }
        let surplus = &mut self.surplus;
        self.receiver.receive(|line| {
            has_arrived = true;
            if line.trim().is_empty() {
                return;
            }
            match room {
                0 => *surplus += 1,
                _ => {
                    room -= 1;
                    rows += row(line).as_deref().unwrap_or(UNREADABLE);
                }
            }
        })?;
        self.rows = MAX_ROWS - room;
        if has_arrived && !mem::replace(&mut self.has_arrived, true) {
            tracing::info!("fixes of GNSS arrive");
        }
        if rows.is_empty() {
            return Ok(());
        }
        self.log.append(&rows)?;
        Ok(self.log.sync.changed()?)
    }

    /// Takes the received datagrams, and ends reception: the log does not change any more.
    pub fn finish(&mut self) -> Result<(), RunError> {
        self.receive()?;
        if mem::replace(&mut self.has_ended, true) {
            return Ok(());
        }
        if let lost @ 1.. = self.receiver.newly_dropped() {
            tracing::warn!(lost, "datagrams with fixes came faster than they are read");
        }
        let surplus = self.surplus();
        self.log.append(&surplus)?;
        Ok(self.log.sync.finish()?)
    }

    fn surplus(&mut self) -> String {
        match mem::take(&mut self.surplus) {
            0 => String::new(),
            surplus => format!("unreadable,{surplus}\n"),
        }
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
    use std::{fs, net::UdpSocket};

    use gyre_geometry::samples::GnssConfig;

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
        let gnss = GnssConfig {
            listen: address.clone(),
            ..GnssConfig::default()
        };
        let mut receiver = GnssReceiver::open(&gnss, &log).unwrap();
        let read = || fs::read_to_string(&log).unwrap();
        assert_eq!(read(), HEADER);
        send(&address, &[b"1,2,3\n2,2,3,4\n\n", b"\xff"]);
        receiver.receive().unwrap();
        let expected = format!("{HEADER}1,2,3,0\n2,2,3,4\n{UNREADABLE}");
        assert_eq!(read(), expected);
        receiver.finish().unwrap();
        drop(receiver);
        let mut flooded = GnssReceiver::open(&gnss, &log).unwrap();
        send(&address, &[b"7\n".repeat(20_000).as_slice()]);
        flooded.finish().unwrap();
        send(&address, &[b"9,2,3"]);
        flooded.finish().unwrap();
        drop(flooded);
        let text = read();
        assert_eq!(text.lines().count(), 4 + MAX_ROWS + 1);
        assert!(text.ends_with("unreadable,15000\n"));
        fs::write(&log, format!("{HEADER}1,2,3,0\n2,2,")).unwrap();
        let mut next = GnssReceiver::open(&gnss, &log).unwrap();
        send(&address, &[b"3,2,3"]);
        next.finish().unwrap();
        assert_eq!(read(), format!("{HEADER}1,2,3,0\n2,2,\n3,2,3,0\n"));
    }
}
