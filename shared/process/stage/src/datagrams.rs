//! Datagrams of live sensors: lines of text.

use std::{
    io::{
        self,
        ErrorKind::{AddrNotAvailable, Interrupted, WouldBlock},
    },
    mem,
    net::UdpSocket,
    os::fd::{AsFd, AsRawFd, BorrowedFd},
};

use gyre_geometry::samples::SensorConfig;
use gyre_transport::RunError;
use thiserror::Error;

const MAX_DATAGRAM: usize = 65_536;
/// Bytes of a turn: the samples of a scan, or as many datagrams of a line each, which count as
/// [`LEAST_BYTES`], as a socket holds by default.
const TURN_BYTES: usize = 1 << 16;
const LEAST_BYTES: usize = 128;

/// Checks that the addresses of these sensors are free, before a run receives there.
pub fn check_addresses(sensors: &[&dyn SensorConfig]) -> Result<(), BadAddress> {
    let mut received = sensors.iter().filter(|it| it.receives());
    received.try_for_each(|sensor| Receiver::open(*sensor).map(drop))
}

#[derive(Debug, Error)]
#[error("cannot receive the {what} at {address} ({section}.listen): {error}")]
pub struct BadAddress {
    what: &'static str,
    section: &'static str,
    address: String,
    error: io::Error,
}

impl BadAddress {
    /// Returns whether this machine may have the address later: its network is not there yet.
    #[must_use]
    pub fn may_come(&self) -> bool {
        self.error.kind() == AddrNotAvailable
    }
}

impl From<BadAddress> for RunError {
    fn from(error: BadAddress) -> Self {
        Self::input(error)
    }
}

pub(crate) struct Receiver {
    socket: UdpSocket,
    datagram: Vec<u8>,
    /// Datagrams that the system had dropped when that was last asked.
    dropped: u32,
}

impl Receiver {
    /// Opens the address of a live sensor.
    pub fn open(sensor: &dyn SensorConfig) -> Result<Self, BadAddress> {
        let (section, address) = (sensor.of().section(), sensor.listen());
        let bound = UdpSocket::bind(address);
        let opened = bound.and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
        let socket = opened.map_err(|error| BadAddress {
            what: match section {
                "gnss" => "fixes of GNSS",
                section => section,
            },
            section,
            address: address.to_owned(),
            error,
        })?;
        Ok(Self {
            socket,
            datagram: vec![0; MAX_DATAGRAM],
            dropped: 0,
        })
    }

    pub fn socket(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    /// Hands over the lines that have arrived, at most one turn of them, so that a sender without a
    /// pause holds nothing up.
    pub fn receive(&mut self, mut each: impl FnMut(&str)) -> Result<(), RunError> {
        let mut left = TURN_BYTES;
        while left > 0 {
            match self.socket.recv(&mut self.datagram) {
                Ok(bytes) => {
                    left = left.saturating_sub(bytes.max(LEAST_BYTES));
                    lines(&self.datagram[..bytes]).for_each(&mut each);
                }
                Err(error) if matches!(error.kind(), WouldBlock | Interrupted) => break,
                Err(error) => return Err(RunError::transport("receive datagrams", error)),
            }
        }
        Ok(())
    }

    /// Returns the number of datagrams that the system has dropped since the last call.
    pub fn newly_dropped(&mut self) -> usize {
        // Its last number is `SK_MEMINFO_DROPS` of `linux/sock_diag.h`.
        let mut counts = [0_u32; 9];
        let mut bytes = size_of_val(&counts) as libc::socklen_t;
        let (fd, to) = (self.socket.as_raw_fd(), counts.as_mut_ptr().cast());
        // SAFETY: the system writes at most `bytes` bytes to `counts`, which has as many.
        unsafe { libc::getsockopt(fd, libc::SOL_SOCKET, libc::SO_MEMINFO, to, &mut bytes) };
        counts[8].wrapping_sub(mem::replace(&mut self.dropped, counts[8])) as usize
    }
}

/// Returns the lines of a datagram; for a datagram that is not text, a line that reports this.
fn lines(datagram: &[u8]) -> impl Iterator<Item = &str> {
    str::from_utf8(datagram).unwrap_or("not text").lines()
}

#[cfg(test)]
mod tests {
    use gyre_geometry::samples::GyroConfig;

    use super::*;

    #[test]
    fn a_sender_without_a_pause_holds_nothing_up_and_what_has_no_room_is_counted() {
        let config = GyroConfig {
            listen: "127.0.0.1:0".to_owned(),
            ..GyroConfig::default()
        };
        let mut receiver = Receiver::open(&config).unwrap();
        let to = receiver.socket.local_addr().unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let send = |text: &[u8]| sender.send_to(text, to).map(drop).unwrap();
        send(b"1,2");
        // Each datagram that is received brings the next one.
        let mut received = Vec::new();
        let next = |line: &str| {
            received.push(line.to_owned());
            send(b"1,2");
        };
        receiver.receive(next).unwrap();
        assert_eq!(received, vec!["1,2"; TURN_BYTES / LEAST_BYTES]);
        (0..3000).for_each(|_| send(b"\xff\xfe"));
        let mut count = 0;
        for _ in 0..10 {
            receiver
                .receive(|line| {
                    assert_eq!(line, if count == 0 { "1,2" } else { "not text" });
                    count += 1;
                })
                .unwrap();
        }
        assert_eq!(count + receiver.newly_dropped(), 3001);
        assert_eq!(receiver.newly_dropped(), 0);
    }
}
