//! The stand-in for the first stages.

use std::{os::fd::BorrowedFd, time::Duration};

use gyre_messages::{Hop, Item, Message, Motion, Scan, StageId};

use crate::{
    Launch, StageCounters, StageError, clock,
    outlet::{Outlet, RecordedMessage, item_of},
    reader::Reader,
    schedule::ScheduleWriter,
    source::{ALIVE_NS, Credit},
    wake,
    writer::Writer,
};

/// Publishes messages of the first stages, which are on another machine, in the place of the
/// source.
pub struct FirstStages<'a> {
    launch: &'a Launch,
    credit: Credit,
    /// The motions that go back to the first stages beside the poses.
    motions: Option<Reader<Motion>>,
    outlets: Vec<Outlet>,
    schedule: ScheduleWriter,
    counters: StageCounters,
    /// The supervisor takes its publisher for a sign that the source has started.
    _scans: Option<Writer<Scan>>,
}

impl<'a> FirstStages<'a> {
    /// Opens the topics. `reads_motions`: the motions of this run are needed on the other machine.
    pub fn open(
        launch: &'a Launch,
        topics: &[&str],
        reads_motions: bool,
    ) -> Result<Self, StageError> {
        let (node, manifest) = (&launch.node, &launch.manifest);
        let motions = reads_motions.then(|| Reader::open(launch, None));
        let outlets = topics.iter().map(|topic| Outlet::open(launch, topic));
        let publishes_scans = topics.contains(&Scan::TOPIC);
        Ok(Self {
            launch,
            credit: Credit::open(launch)?,
            motions: motions.transpose()?,
            outlets: outlets.collect::<Result<_, _>>()?,
            schedule: ScheduleWriter::create(manifest)?,
            counters: StageCounters::default(),
            _scans: match publishes_scans {
                true => None,
                false => Some(Writer::open(node, manifest)?),
            },
        })
    }

    /// Reads the new poses. Call it after each sleep.
    pub fn update(&mut self) -> Result<(), StageError> {
        self.credit.update()
    }

    /// Returns the newest pose of the trajectory at the last start of the last stage; `None` before
    /// its report.
    pub fn resume_at(&self) -> Option<&Item> {
        self.credit.resume_at.as_ref()
    }

    /// Returns whether the last stage has journalled the end of the stream.
    pub fn has_ended(&self) -> bool {
        self.credit.has_ended
    }

    /// Returns the number of the newest pose.
    pub fn newest_pose(&self) -> Option<u64> {
        self.credit.newest
    }

    /// Returns the next motion; `None` if nothing has arrived yet.
    pub fn next_motion(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        self.motions.as_mut().map_or(Ok(None), Reader::take_bytes)
    }

    /// Returns whether the window admits an item.
    pub fn admits(&self, seq: u64) -> bool {
        self.launch.manifest.window.admits(seq, self.credit.newest)
    }

    /// Publishes the messages about item `seq`, one for each topic in the order of
    /// [`open`](Self::open), but for those that have none. Its times on the other machine are on
    /// another clock: here the item begins with its arrival.
    pub fn publish(
        &mut self,
        messages: &[Option<RecordedMessage>],
        seq: u64,
    ) -> Result<(), StageError> {
        let now_ns = clock::now_ns();
        let mut item = Item {
            due_ns: now_ns,
            ..item_of(messages.iter().flatten(), seq)?
        };
        *item.hop_mut(StageId::RadarReplay) = Hop {
            received_ns: now_ns,
            started_ns: now_ns,
            finished_ns: now_ns,
            published_ns: 0,
        };
        for (outlet, message) in self.outlets.iter().zip(messages) {
            let Some(message) = message else { continue };
            outlet.send(message, item)?;
        }
        crate::counters::record(&mut self.counters, 0, clock::now_ns() - now_ns);
        self.schedule.has_published(item.published)
    }

    /// Publishes the end of the stream.
    pub fn end(&mut self, item: Item) -> Result<(), StageError> {
        self.outlets
            .iter()
            .try_for_each(|outlet| outlet.end(item))?;
        self.schedule.has_published(item.published)
    }

    /// Sleeps until there is a pose or a motion, or the connection has something to read, and
    /// answers the handshakes of new readers; true on a request to stop. It is never late: the
    /// other machine may be out of reach.
    pub fn sleep(&mut self, connection: BorrowedFd<'_>) -> Result<bool, StageError> {
        self.schedule.due_at(clock::now_ns() + ALIVE_NS)?;
        let handshakes: Vec<_> = self
            .outlets
            .iter()
            .map(|outlet| outlet.listener())
            .collect();
        let mut data = vec![self.credit.poses.listener()];
        data.extend(self.motions.iter().map(Reader::listener));
        let limit: Duration = wake::MAX_WAIT;
        let signals = &self.launch.signals;
        let woken = signals.wait_or_readable(&data, &handshakes, Some(connection), limit)?;
        self.counters.wakes += 1;
        if woken.may_have_new_readers() {
            let mut outlets = self.outlets.iter();
            outlets.try_for_each(|outlet| outlet.accept_readers())?;
        }
        Ok(woken.stop)
    }

    pub fn counters(&self) -> StageCounters {
        self.counters.clone()
    }
}
