//! The samples of live sensors beside the radar: what arrives in datagrams, or comes with the
//! radar, is handed over with the scan that it belongs to.

use std::{mem, os::fd::BorrowedFd, time::Duration};

use gyre_contract::ScanHeader;
use gyre_geometry::samples::{LiveSamples, MAX_SAMPLES, Sample, SampleKind, SensorConfig};

use super::Sensor;
use crate::{Launch, datagrams::Receiver};
use gyre_transport::RunError;

/// The live sensors beside a radar.
pub(super) struct LiveSensors {
    sensors: Vec<Live>,
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
    /// `None`: the samples come with the radar.
    receiver: Option<Receiver>,
    max_wait_ms: f64,
    /// Lines of datagrams that are no samples.
    unreadable: usize,
}

impl LiveSensors {
    /// Opens the samples of the sections of live sensors; `None` without one.
    pub fn open(launch: &Launch) -> Result<Option<Self>, RunError> {
        let all = launch.sensors()?;
        let live = all.sampled().into_iter().filter(|it| it.kind().is_live());
        let sensors: Vec<Live> = live.map(Live::open).collect::<Result<_, _>>()?;
        let max_wait_ms = sensors.iter().map(|it| it.max_wait_ms).fold(0.0, f64::max);
        Ok((!sensors.is_empty()).then(|| Self {
            sensors,
            of_scan: Vec::new(),
            max_wait: Duration::from_secs_f64(max_wait_ms * 1e-3),
            left_out: 0,
            said_at: 1,
        }))
    }

    pub fn sockets(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let receivers = self.sensors.iter().filter_map(|it| it.receiver.as_ref());
        receivers.map(Receiver::socket)
    }

    /// Takes the samples that have arrived, at most one turn of them.
    pub fn receive(&mut self, radar: &mut impl Sensor) -> Result<(), RunError> {
        for live in &mut self.sensors {
            let arrived = (0..MAX_SAMPLES).map_while(|_| radar.sample(live.kind));
            arrived.for_each(|sample| live.samples.add(&sample));
            if let Some(receiver) = &mut live.receiver {
                receiver.receive(|line| match live.kind.parse(line) {
                    Some(sample) => live.samples.add(&sample),
                    None => live.unreadable += 1,
                })?;
            }
        }
        Ok(())
    }

    /// Returns the samples that are here from the last ones up to `ns` on, in the order of their
    /// stamps.
    pub fn since(&self, ns: i64) -> Vec<Sample> {
        let all = self.sensors.iter();
        let mut samples: Vec<Sample> = all.flat_map(|it| it.samples.since(ns)).copied().collect();
        samples.sort_unstable_by_key(Sample::order);
        samples
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
            left_out += of_sensor + live.newly_left_out();
        }
        self.of_scan.sort_unstable_by_key(Sample::order);
        header.set_samples(bytes, &self.of_scan, left_out);
        self.left_out += left_out;
        if self.left_out >= self.said_at {
            let so_far = self.left_out;
            tracing::warn!(
                so_far,
                "samples of sensors beside the radar are late, unusable or too many, and left out"
            );
            self.said_at = 2 * so_far;
        }
    }
}

impl Live {
    fn open(config: &dyn SensorConfig) -> Result<Self, RunError> {
        let receiver = config.receives().then(|| Receiver::open(config));
        Ok(Self {
            kind: config.of(),
            receiver: receiver.transpose()?,
            max_wait_ms: config.max_wait_ms(),
            samples: LiveSamples::new(config.boxed()),
            unreadable: 0,
        })
    }

    fn newly_left_out(&mut self) -> usize {
        let dropped = self.receiver.as_mut().map_or(0, Receiver::newly_dropped);
        dropped + mem::take(&mut self.unreadable)
    }
}
