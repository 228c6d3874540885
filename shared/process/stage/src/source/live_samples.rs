//! The samples of a live gyro and of live wheels: what arrives in datagrams, or comes with the
//! radar, is handed over with the scan that it belongs to.

use std::{
    mem,
    net::UdpSocket,
    os::fd::{AsFd, BorrowedFd},
    str::FromStr,
    time::Duration,
};

use gyre_contract::ScanHeader;
use gyre_geometry::samples::{
    GyroConfig, GyroKind, LiveSamples, LiveSensor, MAX_SAMPLES, Sample, SampleKind, WheelsConfig,
    WheelsKind,
};

use super::Sensor;
use crate::{
    Launch,
    datagrams::{MAX_DATAGRAM, TURN_BYTES, dropped, lines, listen, receive},
};
use gyre_transport::RunError;

/// The live sensors beside a radar.
pub(super) struct LiveSensors {
    sensors: Vec<Live>,
    datagram: Vec<u8>,
    of_scan: Vec<Sample>,
    /// The longest time for which a scan waits for its samples.
    pub max_wait: Duration,
    /// Samples that were left out so far, and the number for the next report.
    left_out: usize,
    said_at: usize,
}

struct Live {
    kind: SampleKind,
    samples: LiveSamples,
    socket: Option<UdpSocket>,
    /// Parses a line of a datagram; `None` for one that is no sample.
    parse: fn(&str) -> Option<Sample>,
    /// Lines of datagrams that are no samples.
    unreadable: usize,
    /// Datagrams that the system had dropped at the last scan.
    dropped: u32,
}

impl LiveSensors {
    /// Opens the samples of the sections `[gyro]` and `[wheels]`; `None` without one.
    pub fn open(launch: &Launch) -> Result<Option<Self>, RunError> {
        let (gyro, wheels): (GyroConfig, WheelsConfig) =
            (launch.section("gyro")?, launch.section("wheels")?);
        let (mut sensors, mut max_wait_ms) = (Vec::new(), 0_f64);
        if gyro.is_live() {
            max_wait_ms = max_wait_ms.max(gyro.max_wait_ms);
            let listens = (gyro.kind == GyroKind::Udp).then(|| gyro.listen.clone());
            let sensor = LiveSensor::Gyro(gyro);
            sensors.push(Live::open(SampleKind::Gyro, listens, sensor, rates)?);
        }
        if wheels.is_live() {
            max_wait_ms = max_wait_ms.max(wheels.max_wait_ms);
            let listens = (wheels.kind == WheelsKind::Udp).then(|| wheels.listen.clone());
            let sensor = LiveSensor::Wheels(wheels);
            sensors.push(Live::open(SampleKind::Wheels, listens, sensor, speed)?);
        }
        Ok((!sensors.is_empty()).then(|| Self {
            sensors,
            datagram: vec![0; MAX_DATAGRAM],
            of_scan: Vec::new(),
            max_wait: Duration::from_secs_f64(max_wait_ms * 1e-3),
            left_out: 0,
            said_at: 1,
        }))
    }

    pub fn sockets(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let sockets = self.sensors.iter().filter_map(|live| live.socket.as_ref());
        sockets.map(AsFd::as_fd)
    }

    /// Takes the samples that have arrived, at most one turn of them.
    pub fn receive(&mut self, radar: &mut impl Sensor) -> Result<(), RunError> {
        for live in &mut self.sensors {
            let arrived = (0..MAX_SAMPLES).map_while(|_| radar.sample(live.kind));
            arrived.for_each(|sample| live.samples.add(&sample));
            live.receive(&mut self.datagram)?;
        }
        Ok(())
    }

    pub fn cover(&self, header: &ScanHeader) -> bool {
        let until_ns = header.span_ns()[1];
        self.sensors.iter().all(|live| live.samples.cover(until_ns))
    }

    /// Stores the samples of a complete scan behind its powers.
    pub fn store(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) {
        self.of_scan.clear();
        let mut left_out = 0;
        for live in &mut self.sensors {
            let (samples, of_sensor) = live.samples.of_scan(header.span_ns());
            self.of_scan.extend_from_slice(samples);
            left_out += of_sensor + mem::take(&mut live.unreadable) + live.newly_dropped();
        }
        self.of_scan.sort_unstable_by_key(Sample::order);
        header.set_samples(bytes, &self.of_scan, left_out);
        self.left_out += left_out;
        if self.left_out >= self.said_at {
            let so_far = self.left_out;
            tracing::warn!(
                so_far,
                "samples of the gyro or of the wheels are late, unusable or too many, and left out"
            );
            self.said_at = 2 * so_far;
        }
    }
}

impl Live {
    fn open(
        kind: SampleKind,
        listens: Option<String>,
        sensor: LiveSensor,
        parse: fn(&str) -> Option<Sample>,
    ) -> Result<Self, RunError> {
        let section = kind.section();
        let socket = listens.map(|at| listen(section, section, &at));
        Ok(Self {
            kind,
            samples: LiveSamples::new(sensor),
            socket: socket.transpose()?,
            parse,
            unreadable: 0,
            dropped: 0,
        })
    }

    fn newly_dropped(&mut self) -> usize {
        let so_far = self.socket.as_ref().map_or(0, dropped);
        so_far.wrapping_sub(mem::replace(&mut self.dropped, so_far)) as usize
    }

    fn receive(&mut self, datagram: &mut [u8]) -> Result<(), RunError> {
        let Some(socket) = &self.socket else {
            return Ok(());
        };
        let mut left = TURN_BYTES;
        while let Some(bytes) = receive(socket, datagram, &mut left)? {
            for line in lines(&datagram[..bytes]) {
                match (self.parse)(line) {
                    Some(sample) => self.samples.add(&sample),
                    None => self.unreadable += 1,
                }
            }
        }
        Ok(())
    }
}

/// Parses a sample of a gyro: a stamp, ns, and the rates about x, y and z, rad/s; then, if they are
/// measured, the accelerations, m/s².
fn rates(line: &str) -> Option<Sample> {
    let (stamp_ns, rest) = line.trim().split_once(',')?;
    let mut sample = Sample::yaw_rate(stamp_ns.trim().parse().ok()?, 0.0);
    let values: Result<Vec<f64>, _> = rest.split(',').map(|it| f64::from_str(it.trim())).collect();
    let values = values.ok()?;
    let is_whole = matches!(values.len(), 3 | 6);
    sample.values[..values.len().min(6)].copy_from_slice(values.get(..values.len().min(6))?);
    is_whole.then_some(sample)
}

/// Parses a sample of the wheels: a stamp, ns, and the speed, m/s.
fn speed(line: &str) -> Option<Sample> {
    let (stamp_ns, speed_mps) = line.trim().split_once(',')?;
    Some(Sample::speed(
        stamp_ns.trim().parse().ok()?,
        speed_mps.trim().parse().ok()?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_datagram_has_a_sample_in_each_line() {
        let text = b"1700000000000000001, 0.1,-0.2,0.3\n1700000000000000002,0,0,1e-3,0.5,0,9.8\n";
        let found: Vec<_> = lines(text).map(rates).collect();
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
        let text = b"1700000000000000001, 8.25\n17,-1\n";
        let found: Vec<_> = lines(text).map(speed).collect();
        let expected = [Sample::speed(first, 8.25), Sample::speed(17, -1.0)];
        assert_eq!(found, expected.map(Some));
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
            let found: Vec<_> = lines(text).map(rates).collect();
            assert_eq!(found, [None], "{text:?}");
        }
        for text in [&b"hello"[..], b"17", b"17,x", b"1.5,3", b"17,3,4", b"\xff"] {
            let found: Vec<_> = lines(text).map(speed).collect();
            assert_eq!(found, [None], "{text:?}");
        }
    }
}
