//! The loop of a source that a sensor drives: a scan is published when it is complete, and nothing
//! is ever asked for again.

use std::{os::fd::BorrowedFd, time::Duration};

use gyre_contract::{
    GnssHeader, Intake, IntakeHeader, NumberedBy, Scan, ScanHeader, StageId,
    control::{RECEIVED, Received},
    run::StageCounters,
};
use gyre_geometry::samples::{MAX_SAMPLES, Sample, SampleKind};
use gyre_transport::{
    Generation, RunError, clock,
    numbers::Numbers,
    received, wake,
    writer::{Draft, Writer},
};

use super::{Feed, hop, live_samples::LiveSensors, position::Position, predictions::Predictions};
use crate::{Launch, counters::Work};

/// A sensor that delivers scans at its own pace.
pub trait Sensor {
    /// The stage that it is, or replaces.
    const HOP: StageId;

    /// The connection to wait for, while there is one.
    fn connection(&self) -> Option<BorrowedFd<'_>>;

    /// Takes the received data and writes them into shared memory, without waiting. After
    /// [`Arrival::Scan`] it is called again at once, with memory for the next scan.
    fn take(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<Arrival, RunError>;

    /// Returns when the scan that was returned last was complete by the sensor's clock,
    /// `CLOCK_MONOTONIC`, ns, however late it was read; `None` if that is not known: then its
    /// latency counts from when it was read.
    fn due_ns(&self) -> Option<i64>;

    /// Takes the next sample of a gyro or of wheels that comes with the sensor, in its own axes and
    /// on its own clock.
    fn sample(&mut self, of: SampleKind) -> Option<Sample> {
        let _ = of;
        None
    }

    /// The descriptor that becomes readable when such a sample has come.
    fn samples(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// Takes the next message of a GNSS receiver that comes with the sensor.
    fn fix(&mut self) -> Option<GnssHeader> {
        None
    }

    /// Continues to count after a dead source.
    fn resume(&mut self, before: Received);

    fn received(&self) -> Received;
}

/// The event of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    Scan,
    /// No scan is complete yet. Without a connection [`Sensor::take`] is to be called again after
    /// this time.
    Nothing(Duration),
    /// No scan can be complete before this time has passed: the connection need not wake until
    /// then.
    Later(Duration),
}

/// Publishes the scans of a sensor until SIGTERM, or until `scans` scans are published.
pub fn run_sensor(
    launch: &Launch,
    sensor: &mut impl Sensor,
    scans: Option<u64>,
) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    sensor.resume(received::read(&launch.manifest).unwrap_or_default());
    let mut stream = Stream {
        received: received::open(&launch.manifest)?,
        live: LiveSensors::open(launch)?,
        predictions: Predictions::open(launch)?,
        intake: Writer::open(&launch.node, &launch.manifest)?,
        feed: Feed::of_scans(launch)?.never_late(),
    };
    let ended = stream.publish(sensor, scans);
    let received = sensor.received();
    stream.received.write(received.to_numbers())?;
    received.count(&mut stream.feed.counters);
    stream.feed.finish(ended)
}

/// The event that ends a sleep, besides its time and the signals.
#[derive(Clone, Copy)]
enum Wait {
    Time,
    /// Data of the sensor.
    Data,
    /// Samples of the sensors beside it.
    Samples,
}

struct Stream<'a> {
    feed: Feed<'a, Scan>,
    intake: Writer<Intake>,
    received: Numbers<RECEIVED>,
    live: Option<LiveSensors>,
    /// `None`: the run predicts no poses.
    predictions: Option<Predictions>,
}

impl Stream<'_> {
    fn publish<S: Sensor>(&mut self, sensor: &mut S, scans: Option<u64>) -> Result<(), RunError> {
        let newest = self.feed.wait_for_start()?;
        let mut position = Position::after(&newest, self.feed.schedule.before);
        // A restarted run knows the number of scans published up to its newest pose.
        let (manifest, first) = (&self.feed.launch.manifest, position.published);
        let generation = Generation::begin(manifest, NumberedBy::Source, &newest, first)?;
        while scans.is_none_or(|scans| position.published < scans) {
            let mut draft = self.feed.scans().loan()?;
            let started_ns = self.take(sensor, &mut draft)?;
            self.add_samples(sensor, &mut draft)?;
            let item = &mut draft.header().item;
            position.identify(item);
            generation.mark(item);
            *item.hop_mut(S::HOP) = hop(started_ns, clock::now_ns());
            item.due_ns = sensor.due_ns().unwrap_or(started_ns).min(started_ns);
            // In this order a death in between leaves a number without a scan, which counts as
            // dropped, and no scan without a number.
            self.feed.schedule.has_published(position.published)?;
            let (item, received) = (*item, sensor.received());
            self.received.write(received.to_numbers())?;
            if let Some(predictions) = &mut self.predictions {
                predictions.set_clock(draft.header().span_ns()[1], item.due_ns);
            }
            self.feed.scans().send(draft, S::HOP)?;
            self.intake
                .publish(IntakeHeader::of(item, &received), Some(S::HOP))?;
            position.advance();
            // However fast scans come, there is time for signals and for new readers.
            self.sleep(sensor, Wait::Data, Duration::ZERO)?;
        }
        let mut end = position.item();
        generation.mark(&mut end);
        self.intake.end(end, Some(S::HOP))?;
        self.feed.end(end)?;
        loop {
            self.feed.sleep(wake::MAX_WAIT)?;
        }
    }

    /// Waits for the next scan; returns when the reading of its end began, ns.
    fn take(&mut self, sensor: &mut impl Sensor, draft: &mut Draft<Scan>) -> Result<i64, RunError> {
        loop {
            let work = Work::begin();
            let (header, bytes) = draft.parts();
            let arrival = sensor.take(header, bytes)?;
            if let Some(fixes) = &mut self.feed.fixes {
                let mut arrived = (0..MAX_SAMPLES).map_while(|_| sensor.fix());
                arrived.try_for_each(|fix| fixes.publish(fix))?;
            }
            match arrival {
                Arrival::Scan => {
                    work.end(&mut self.feed.counters);
                    return Ok(work.started_ns);
                }
                Arrival::Nothing(limit) => {
                    self.received.write(sensor.received().to_numbers())?;
                    self.sleep(sensor, Wait::Data, limit)?;
                }
                Arrival::Later(time) => self.sleep(sensor, Wait::Time, time)?,
            }
        }
    }

    fn add_samples(
        &mut self,
        sensor: &mut impl Sensor,
        draft: &mut Draft<Scan>,
    ) -> Result<(), RunError> {
        let Some(live) = &self.live else {
            return Ok(());
        };
        let until_ns = clock::now_ns() + live.max_wait.as_nanos() as i64;
        while let Some(live) = &mut self.live {
            live.receive(sensor)?;
            let left = clock::until(until_ns);
            if live.cover(draft.header()) || left.is_zero() {
                let (header, bytes) = draft.parts();
                live.store(header, bytes);
                break;
            }
            self.sleep(sensor, Wait::Samples, left)?;
        }
        Ok(())
    }

    /// Sleeps, and publishes the predictions that become due meanwhile.
    fn sleep(
        &mut self,
        sensor: &mut impl Sensor,
        wait: Wait,
        limit: Duration,
    ) -> Result<(), RunError> {
        let due = self.predictions.as_ref().map(Predictions::until_due);
        let limit = due.map_or(limit, |due| due.min(limit));
        let feed = &mut self.feed;
        match (wait, &self.live) {
            (Wait::Time, _) => feed.sleep(limit)?,
            (Wait::Data, _) => feed.sleep_until(None, sensor.connection(), limit)?,
            (Wait::Samples, live) => {
                let sockets = live.iter().flat_map(LiveSensors::sockets);
                feed.sleep_until(None, sockets.chain(sensor.samples()), limit)?;
            }
        }
        let Some(predictions) = &mut self.predictions else {
            return Ok(());
        };
        feed.credit.update()?;
        if let Some(live) = &mut self.live {
            live.receive(sensor)?;
        }
        let live = &self.live;
        let samples = |ns| live.as_ref().map_or(Vec::new(), |live| live.since(ns));
        predictions.publish_due(&feed.credit, samples)
    }
}
