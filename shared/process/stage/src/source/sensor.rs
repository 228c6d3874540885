//! The loop of a source that a sensor drives: a scan is published when it is complete, and nothing
//! is ever asked for again.

use std::{os::fd::BorrowedFd, time::Duration};

use gyre_messages::{Hop, NumberedBy, Scan, ScanHeader, StageId};
use gyre_samples::{Sample, SampleKind};

use super::{
    Credit,
    live_samples::LiveSensors,
    position::Position,
    received::{self, Received, ReceivedWriter},
};
use crate::{
    Generation, Launch, StageCounters, StageError, allocations, clock,
    schedule::ScheduleWriter,
    wake,
    writer::{Draft, Writer},
};

/// Time without need for the supervisor to intervene: this loop repeatedly reports that it is not
/// late, since a radar that is switched off is no reason to restart it.
pub(crate) const ALIVE_NS: i64 = 5_000_000_000;
/// Time between two such words, ns: it wakes many times for each scan, and a word is a write to a
/// file.
const SAID_EVERY_NS: i64 = 1_000_000_000;

/// A sensor that delivers scans at its own pace.
pub trait Sensor {
    /// The stage that it is, or replaces.
    const HOP: StageId;

    /// The connection to wait for, while there is one.
    fn connection(&self) -> Option<BorrowedFd<'_>>;

    /// Takes the received data and writes them into shared memory, without waiting. After
    /// [`Arrival::Scan`] it is called again at once, with memory for the next scan.
    fn take(&mut self, header: &mut ScanHeader, bytes: &mut [u8]) -> Result<Arrival, StageError>;

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

    /// Continues to count after a dead source.
    fn resume(&mut self, before: Received);

    /// Returns the deliveries and losses since the start of the run.
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
) -> Result<StageCounters, StageError> {
    if !launch.take_place()? {
        return Ok(StageCounters::default());
    }
    sensor.resume(received::read(&launch.manifest).unwrap_or_default());
    let mut stream = Stream {
        launch,
        received: ReceivedWriter::open(&launch.manifest)?,
        credit: Credit::open(launch)?,
        schedule: ScheduleWriter::resume(&launch.manifest)?,
        scans: Writer::open(&launch.node, &launch.manifest)?,
        counters: StageCounters::default(),
        live: LiveSensors::open(launch)?,
        said_ns: 0,
    };
    if let Some(start) = stream.wait_for_start()? {
        stream.publish(sensor, start, scans)?;
    }
    let received = sensor.received();
    stream.received.write(received)?;
    received.count(&mut stream.counters);
    Ok(stream.counters)
}

struct Stream<'a> {
    launch: &'a Launch,
    credit: Credit,
    schedule: ScheduleWriter,
    scans: Writer<Scan>,
    counters: StageCounters,
    received: ReceivedWriter,
    live: Option<LiveSensors>,
    /// Time of the last sign of life to the supervisor, `CLOCK_MONOTONIC`, ns.
    said_ns: i64,
}

impl Stream<'_> {
    /// Waits until the sink has reported the newest pose; `None` on a request to stop.
    fn wait_for_start(&mut self) -> Result<Option<Position>, StageError> {
        loop {
            // The sink republishes its last poses one by one and notifies after all of them.
            if self.sleep(None, wake::MAX_WAIT)? {
                return Ok(None);
            }
            self.credit.update()?;
            if let Some(newest) = self.credit.resume_at {
                let position = Position::after(&newest, self.schedule.published_before());
                return Ok(Some(position));
            }
        }
    }

    fn publish<S: Sensor>(
        &mut self,
        sensor: &mut S,
        mut position: Position,
        scans: Option<u64>,
    ) -> Result<(), StageError> {
        let newest = self.credit.resume_at.unwrap_or_default();
        // A restarted run knows the number of scans published up to its newest pose.
        let (manifest, first) = (&self.launch.manifest, position.published);
        let generation = Generation::begin(manifest, NumberedBy::Source, &newest, first)?;
        while scans.is_none_or(|scans| position.published < scans) {
            let mut draft = self.scans.loan()?;
            let started_ns = loop {
                let (started_ns, allocated) = (clock::now_ns(), allocations::so_far());
                let (header, bytes) = draft.parts();
                let arrival = sensor.take(header, bytes)?;
                let finished_ns = clock::now_ns();
                match arrival {
                    Arrival::Scan => {
                        let allocations = allocations::so_far() - allocated;
                        crate::counters::record(
                            &mut self.counters,
                            allocations,
                            finished_ns - started_ns,
                        );
                        break started_ns;
                    }
                    Arrival::Nothing(limit) => {
                        self.received.write(sensor.received())?;
                        if self.sleep(sensor.connection(), limit)? {
                            return Ok(());
                        }
                    }
                    Arrival::Later(time) => {
                        if self.sleep(None, time)? {
                            return Ok(());
                        }
                    }
                }
            };
            if !self.add_samples(sensor, &mut draft)? {
                return Ok(());
            }
            let header = draft.header();
            position.identify(&mut header.item);
            generation.mark(&mut header.item);
            *header.item.hop_mut(S::HOP) = Hop {
                received_ns: started_ns,
                started_ns,
                finished_ns: clock::now_ns(),
                published_ns: 0,
            };
            let due_ns = sensor.due_ns().unwrap_or(started_ns);
            header.item.due_ns = due_ns.min(started_ns);
            // In this order a death in between leaves a number without a scan, which counts as
            // dropped, and no scan without a number.
            self.schedule.has_published(position.published)?;
            self.received.write(sensor.received())?;
            self.scans.send(draft, S::HOP)?;
            position.advance();
            // However fast scans come, there is time for signals and for new readers.
            if self.sleep(sensor.connection(), Duration::ZERO)? {
                return Ok(());
            }
        }
        let mut draft = self.scans.loan()?;
        draft.header().item = position.end();
        generation.mark(&mut draft.header().item);
        self.scans.send(draft, S::HOP)?;
        self.schedule.has_published(position.published)?;
        while !self.sleep(None, wake::MAX_WAIT)? {}
        Ok(())
    }

    /// Waits for the samples of a complete scan, and adds them; false on a request to stop.
    fn add_samples<S: Sensor>(
        &mut self,
        sensor: &mut S,
        draft: &mut Draft<Scan>,
    ) -> Result<bool, StageError> {
        let Some(mut live) = self.live.take() else {
            return Ok(true);
        };
        let until_ns = clock::now_ns() + live.max_wait().as_nanos() as i64;
        loop {
            live.receive(sensor)?;
            let left = clock::until(until_ns);
            if live.cover(draft.header()) || left.is_zero() {
                break;
            }
            if self.sleep(live.sockets().chain(sensor.samples()), left)? {
                return Ok(false);
            }
        }
        let (header, bytes) = draft.parts();
        live.store(header, bytes);
        self.live = Some(live);
        Ok(true)
    }

    /// Sleeps until a connection has something to read, and answers the handshakes of new readers;
    /// true on a request to stop.
    fn sleep<'fd>(
        &mut self,
        connections: impl IntoIterator<Item = BorrowedFd<'fd>>,
        limit: Duration,
    ) -> Result<bool, StageError> {
        let now_ns = clock::now_ns();
        if now_ns >= self.said_ns + SAID_EVERY_NS {
            self.schedule.due_at(now_ns + ALIVE_NS)?;
            self.said_ns = now_ns;
        }
        let woken = self.launch.signals.wait_or_readable(
            &[self.credit.poses.listener()],
            &[self.scans.listener()],
            connections,
            limit.min(wake::MAX_WAIT),
        )?;
        self.counters.wakes += 1;
        if woken.may_have_new_readers() {
            self.scans.accept_readers()?;
        }
        Ok(woken.stop)
    }
}
