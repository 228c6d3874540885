//! The stand-in for the first stages.

use std::os::fd::BorrowedFd;

use gyre_messages::{Item, Message, Motion, Scan, StageId};

use crate::{
    Launch, StageCounters, StageError, clock, counters,
    outlet::{RecordedMessage, item_of},
    reader::Reader,
    source::{Feed, hop},
    wake,
    writer::{TopicWriter, Writer},
};

/// Publishes messages of the first stages, which are on another machine, in the place of the
/// source. It is never late: the other machine may be out of reach.
pub struct FirstStages<'a> {
    feed: Feed<'a, Vec<TopicWriter>>,
    /// The motions that go back to the first stages beside the poses.
    motions: Option<Reader<Motion>>,
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
        let motions = reads_motions.then(|| Reader::open(launch, None));
        let publishes_scans = topics.contains(&Scan::TOPIC);
        let scans = || Writer::open(&launch.node, &launch.manifest);
        Ok(Self {
            motions: motions.transpose()?,
            feed: Feed::open(launch, || TopicWriter::of_stream(launch, topics))?.never_late(),
            _scans: (!publishes_scans).then(scans).transpose()?,
        })
    }

    /// Reads the new poses. Call it after each sleep.
    pub fn update(&mut self) -> Result<(), StageError> {
        self.feed.credit.update()
    }

    /// Returns the newest pose of the trajectory at the last start of the last stage; `None` before
    /// its report.
    pub fn resume_at(&self) -> Option<&Item> {
        self.feed.credit.resume_at.as_ref()
    }

    /// Returns whether the last stage has journalled the end of the stream.
    pub fn has_ended(&self) -> bool {
        self.feed.credit.has_ended
    }

    pub fn newest_pose(&self) -> Option<u64> {
        self.feed.credit.newest
    }

    /// Returns the next motion; `None` if nothing has arrived yet.
    pub fn next_motion(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        self.motions.as_mut().map_or(Ok(None), Reader::take_bytes)
    }

    pub fn admits(&self, seq: u64) -> bool {
        let window = &self.feed.launch.manifest.window;
        window.admits(seq, self.newest_pose())
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
        *item.hop_mut(StageId::RadarReplay) = hop(now_ns, now_ns);
        for (output, message) in self.feed.outputs.iter().zip(messages) {
            if let Some(message) = message {
                output.republish(message, item)?;
            }
        }
        counters::record(&mut self.feed.counters, 0, clock::now_ns() - now_ns);
        self.feed.schedule.has_published(item.published)
    }

    pub fn end(&mut self, item: Item) -> Result<(), StageError> {
        self.feed.end(item)
    }

    /// Sleeps until there is a pose or a motion, or the connection has something to read, and
    /// answers the handshakes of new readers; true on a request to stop.
    pub fn sleep(&mut self, connection: BorrowedFd<'_>) -> Result<bool, StageError> {
        let motions = self.motions.as_ref().map(Reader::listener);
        let slept = self
            .feed
            .sleep_until(motions, Some(connection), wake::MAX_WAIT);
        match slept {
            Err(StageError::Stopped) => Ok(true),
            slept => slept.map(|()| false),
        }
    }

    pub fn counters(&self) -> StageCounters {
        self.feed.counters.clone()
    }
}
