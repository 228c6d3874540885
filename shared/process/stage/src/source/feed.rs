//! The parts of every source: the progress of the run, its schedule, and its topics.

use std::{mem, os::fd::BorrowedFd, time::Duration};

use gyre_contract::{Hop, Item, Pose, PoseHeader, Scan, StageId, flag, run::StageCounters};
use gyre_transport::{
    Listener, RunError, clock,
    reader::{Port, Received},
    wake,
    writer::Writer,
};

use super::fixes::Fixes;
use crate::{Launch, schedule::ScheduleWriter};

/// Time without need for the supervisor to intervene: a source that waits for a sensor or for
/// another machine repeatedly reports that it is not late, since no restart would help.
const ALIVE_NS: i64 = 5_000_000_000;
/// Time between two such words, ns: it wakes many times for each scan, and a word is a write to a
/// file.
const SAID_EVERY_NS: i64 = 1_000_000_000;

/// A source without its input.
pub(crate) struct Feed<'a, M> {
    pub launch: &'a Launch,
    pub credit: Credit,
    pub schedule: ScheduleWriter,
    pub outputs: Vec<Writer<M>>,
    pub counters: StageCounters,
    /// `None`: the run has no live receiver of GNSS.
    pub fixes: Option<Fixes>,
    may_have_new_readers: bool,
    /// Time of the last sign of life of a source that is never late, `CLOCK_MONOTONIC`, ns.
    said_ns: Option<i64>,
}

impl<'a> Feed<'a, Scan> {
    pub fn of_scans(launch: &'a Launch) -> Result<Self, RunError> {
        Self::open(launch, || {
            Ok(vec![Writer::open(&launch.node, &launch.manifest)?])
        })
    }

    pub fn scans(&self) -> &Writer<Scan> {
        &self.outputs[0]
    }
}

impl<'a, M> Feed<'a, M> {
    /// Reads the poses, and opens the topics afterwards.
    pub fn open(
        launch: &'a Launch,
        outputs: impl FnOnce() -> Result<Vec<Writer<M>>, RunError>,
    ) -> Result<Self, RunError> {
        Ok(Self {
            launch,
            credit: Credit::open(launch)?,
            schedule: ScheduleWriter::create(&launch.manifest)?,
            outputs: outputs()?,
            counters: StageCounters::default(),
            fixes: Fixes::open(launch)?,
            may_have_new_readers: false,
            said_ns: None,
        })
    }

    pub fn never_late(self) -> Self {
        Self {
            said_ns: Some(0),
            ..self
        }
    }

    /// Waits until the sink has reported the newest pose.
    pub fn wait_for_start(&mut self) -> Result<Item, RunError> {
        loop {
            // Sleep first. The sink republishes its last poses one by one and notifies after all of
            // them. Reading earlier could take an older pose for the newest, and more scans would
            // be sent than the readers have room for.
            self.sleep(wake::MAX_WAIT)?;
            self.credit.update()?;
            if let Some(newest) = self.credit.resume_at {
                return Ok(newest);
            }
        }
    }

    /// Waits until an item is due and the window admits it, or all are admitted.
    pub fn wait_for_admission(
        &mut self,
        seq: u64,
        due_ns: Option<i64>,
        admits_all: bool,
    ) -> Result<(), RunError> {
        self.schedule.due_at(due_ns.unwrap_or_else(clock::now_ns))?;
        let window = self.launch.manifest.window;
        let mut has_slept = false;
        loop {
            self.credit.update()?;
            let wait = due_ns.map_or(Duration::ZERO, clock::until);
            let has_credit = admits_all || window.admits(seq, self.credit.newest);
            if has_credit && wait.is_zero() && has_slept {
                return Ok(());
            }
            // However slowly scans are read, there is time for signals, new readers and a beat.
            self.sleep(match has_credit {
                true => wait.min(wake::MAX_WAIT),
                false => wake::MAX_WAIT,
            })?;
            has_slept = true;
        }
    }

    pub fn sleep(&mut self, limit: Duration) -> Result<(), RunError> {
        self.sleep_until(None, None, limit)
    }

    /// Answers the handshakes of new readers, publishes the fixes that have arrived, and sleeps
    /// until there is a pose, or something to read on a connection or at a listener. In this order,
    /// since the scan that has become due when the sleep ends goes first.
    pub fn sleep_until<'fd>(
        &mut self,
        listener: Option<&Listener>,
        connections: impl IntoIterator<Item = BorrowedFd<'fd>>,
        limit: Duration,
    ) -> Result<(), RunError> {
        let now_ns = clock::now_ns();
        if self.said_ns.is_some_and(|ns| now_ns >= ns + SAID_EVERY_NS) {
            self.schedule.due_at(now_ns + ALIVE_NS)?;
            self.said_ns = Some(now_ns);
        }
        let outputs = self.outputs.iter();
        if mem::take(&mut self.may_have_new_readers) {
            outputs.clone().try_for_each(Writer::accept_readers)?;
        }
        self.fixes.iter_mut().try_for_each(Fixes::receive)?;
        let handshakes: Vec<_> = outputs.map(Writer::listener).collect();
        let mut data = vec![self.credit.poses.listener()];
        data.extend(listener);
        let signals = &self.launch.signals;
        let limit = limit.min(wake::MAX_WAIT);
        let woken = signals.wait_or_readable(&data, &handshakes, connections, limit)?;
        self.counters.wakes += 1;
        self.may_have_new_readers = woken.may_have_new_readers;
        match woken.stop {
            true => Err(RunError::Stopped),
            false => Ok(()),
        }
    }

    pub fn end(&mut self, item: Item) -> Result<(), RunError> {
        // The fixes of the drive precede its end.
        self.fixes.iter_mut().try_for_each(Fixes::receive)?;
        let mut outputs = self.outputs.iter();
        outputs.try_for_each(|output| output.end(item, Some(StageId::RadarReplay)))?;
        self.schedule.has_published(item.published)
    }

    pub fn finish(mut self, ended: Result<(), RunError>) -> Result<StageCounters, RunError> {
        match ended {
            Ok(()) | Err(RunError::Stopped) => {}
            Err(error) => return Err(error),
        }
        self.fixes.iter_mut().try_for_each(Fixes::receive)?;
        Ok(self.counters)
    }
}

/// The time stamps of a source before the publication.
pub(crate) fn hop(started_ns: i64, finished_ns: i64) -> Hop {
    Hop {
        received_ns: started_ns,
        started_ns,
        finished_ns,
        published_ns: 0,
    }
}

/// The progress of the run, from its poses.
pub struct Credit {
    pub poses: Port<Pose>,
    pub newest: Option<u64>,
    /// The newest pose that was taken.
    pub last: Option<PoseHeader>,
    /// The number of the newest pose at the source.
    pub published: Option<u64>,
    /// The newest pose of the trajectory at the last start of the sink.
    pub resume_at: Option<Item>,
    pub has_ended: bool,
}

impl Credit {
    pub fn open(launch: &Launch) -> Result<Self, RunError> {
        Ok(Self {
            poses: launch.port()?,
            newest: None,
            last: None,
            published: None,
            resume_at: None,
            has_ended: false,
        })
    }

    pub fn update(&mut self) -> Result<(), RunError> {
        while self.take()?.is_some() {}
        Ok(())
    }

    /// Takes the next pose into account and returns it; `None` if no pose has come.
    pub fn take(&mut self) -> Result<Option<Received<Pose>>, RunError> {
        let Some(pose) = self.poses.receive()? else {
            return Ok(None);
        };
        let item = pose.item();
        self.has_ended |= item.is(flag::END);
        if item.is(flag::SYNC) {
            self.resume_at = Some(*item);
        }
        if !item.is(flag::BASE) && !item.is(flag::END) {
            self.newest = self.newest.max(Some(item.seq));
            self.last = Some(*pose.header());
            self.published = self.published.max(Some(item.published));
        }
        Ok(Some(pose))
    }
}
