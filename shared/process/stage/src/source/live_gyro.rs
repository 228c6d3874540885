//! The samples of a live gyro: what arrives in datagrams, or comes with the sensor, is handed over
//! with the scan that it belongs to.

use std::{
    io::ErrorKind,
    net::UdpSocket,
    os::fd::{AsFd, BorrowedFd},
    str::FromStr,
    time::Duration,
};

use gyre_messages::ScanHeader;
use gyre_samples::{GyroConfig, GyroKind, LiveSamples, Sample};

use super::Sensor;
use crate::{Launch, StageError};

/// The largest datagram, bytes: that of UDP.
const MAX_DATAGRAM: usize = 65_536;

/// A live gyro.
pub(super) struct LiveGyro {
    samples: LiveSamples,
    socket: Option<UdpSocket>,
    datagram: Vec<u8>,
    max_wait: Duration,
    /// Lines of datagrams that are no samples.
    unreadable: usize,
    /// Samples that were left out so far, and the number at which that is said next.
    left_out: usize,
    said_at: usize,
}

impl LiveGyro {
    /// Opens the gyro of the section `[gyro]`; `None` without one.
    ///
    /// # Errors
    /// An address at which nothing can be received.
    pub fn open(launch: &Launch) -> Result<Option<Self>, StageError> {
        let config: GyroConfig = launch.section("gyro")?;
        if !config.is_live() {
            return Ok(None);
        }
        let socket = match config.kind {
            GyroKind::Udp => Some(listen(&config.listen)?),
            _ => None,
        };
        Ok(Some(Self {
            samples: LiveSamples::new(&config),
            socket,
            datagram: vec![0; MAX_DATAGRAM],
            max_wait: Duration::from_secs_f64(config.max_wait_ms * 1e-3),
            unreadable: 0,
            left_out: 0,
            said_at: 1,
        }))
    }

    /// The longest time for which a scan waits for its samples.
    pub fn max_wait(&self) -> Duration {
        self.max_wait
    }

    /// The socket to wait for, if there is one.
    pub fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.socket.as_ref().map(AsFd::as_fd)
    }

    /// Takes what has arrived.
    ///
    /// # Errors
    /// The socket fails.
    pub fn receive(&mut self, sensor: &mut impl Sensor) -> Result<(), StageError> {
        while let Some(sample) = sensor.gyro_sample() {
            self.samples.add(&sample);
        }
        let Some(socket) = &self.socket else {
            return Ok(());
        };
        loop {
            match socket.recv(&mut self.datagram) {
                Ok(bytes) => {
                    for sample in samples_in(&self.datagram[..bytes]) {
                        match sample {
                            Some(sample) => self.samples.add(&sample),
                            None => self.unreadable += 1,
                        }
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(StageError::transport("receive the gyro", error)),
            }
        }
    }

    /// Returns whether a complete scan has all its samples.
    pub fn covers(&self, header: &ScanHeader) -> bool {
        self.samples.cover(header.span_ns()[1])
    }

    /// Stores the samples of a complete scan behind its powers.
    pub fn store(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) {
        let (samples, left_out) = self.samples.of_scan(header.span_ns());
        let left_out = left_out + std::mem::take(&mut self.unreadable);
        header.set_samples(bytes, samples, left_out);
        self.left_out += left_out;
        if self.left_out >= self.said_at {
            let so_far = self.left_out;
            tracing::warn!(
                so_far,
                "samples of the gyro are late or unusable, and left out"
            );
            self.said_at = 2 * so_far;
        }
    }
}

fn listen(address: &str) -> Result<UdpSocket, StageError> {
    let bound = UdpSocket::bind(address);
    let opened = bound.and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
    opened.map_err(|error| {
        StageError::Input(format!(
            "cannot receive the gyro at {address} (gyro.listen): {error}"
        ))
    })
}

/// Returns the samples of a datagram, line by line; `None` for one that is no sample: a stamp, ns,
/// and the rates about x, y and z, rad/s; then, if they are measured, the accelerations, m/s².
fn samples_in(datagram: &[u8]) -> impl Iterator<Item = Option<Sample>> {
    let text = str::from_utf8(datagram).unwrap_or("not text");
    text.lines().map(sample)
}

fn sample(line: &str) -> Option<Sample> {
    let (stamp_ns, rest) = line.trim().split_once(',')?;
    let mut sample = Sample::yaw_rate(stamp_ns.trim().parse().ok()?, 0.0);
    let values: Result<Vec<f64>, _> = rest.split(',').map(|it| f64::from_str(it.trim())).collect();
    let values = values.ok()?;
    let is_whole = matches!(values.len(), 3 | 6);
    sample.values[..values.len().min(6)].copy_from_slice(values.get(..values.len().min(6))?);
    is_whole.then_some(sample)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_datagram_has_a_sample_in_each_line() {
        let text = b"1700000000000000001, 0.1,-0.2,0.3\n1700000000000000002,0,0,1e-3,0.5,0,9.8\n";
        let found: Vec<_> = samples_in(text).collect();
        let expected = |stamp_ns, values| {
            Some(Sample {
                stamp_ns,
                values,
                ..Sample::yaw_rate(0, 0.0)
            })
        };
        let [first, second] = [1, 2].map(|ns| 1_700_000_000_000_000_000 + ns);
        assert_eq!(
            found,
            [
                expected(first, [0.1, -0.2, 0.3, 0.0, 0.0, 0.0]),
                expected(second, [0.0, 0.0, 1e-3, 0.5, 0.0, 9.8]),
            ]
        );
    }

    #[test]
    fn what_is_no_sample_is_told() {
        for text in [
            &b"hello"[..],
            b"1700000000000000001",
            b"1700000000.5,0,0,0",
            b"1700000000000000001,0,0",
            b"1700000000000000001,0,0,0,1",
            b"1700000000000000001,0,0,0,1,2,3,4",
            b"1700000000000000001,0,x,0",
            b"\xff\xfe",
        ] {
            assert_eq!(samples_in(text).collect::<Vec<_>>(), [None], "{text:?}");
        }
    }
}
