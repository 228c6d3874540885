//! The loop of the first stage: publishes a scan when the window admits it and, at a given rate, when it is due.

mod pace;
mod position;

use std::time::Duration;

use gyre_messages::{Hop, Item, Pose, Scan, ScanHeader, StageId, flag};

use crate::{
    Launch, StageCounters, StageError, allocations, clock,
    reader::Port,
    wake,
    writer::{Draft, Writer},
};
use pace::Pace;
use position::Position;

/// A source of scans, numbered from 0.
pub trait Source {
    /// Number of scans.
    fn len(&self) -> usize;

    /// Returns whether there are no scans.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Time at which scan `index` is complete on the sensor's clock, ns since 1970, if it is known without reading the scan.
    /// Without it a restarted source in live mode cannot tell which scans it has missed, and plays them late.
    fn complete_ns(&self, index: usize) -> Option<i64>;

    /// Returns whether live mode drops the scans that become due while this process is busy or down, as with a real sensor.
    fn drops_missed_scans(&self) -> bool;

    /// Reads scan `index` into shared memory.
    ///
    /// # Errors
    /// One sentence that says why the scan cannot be used. It is skipped.
    fn read(
        &mut self,
        index: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<(), String>;
}

/// Runs the source until SIGTERM.
///
/// # Errors
/// A failure of the transport.
pub fn run(launch: &Launch, source: &mut impl Source) -> Result<StageCounters, StageError> {
    let credit = Credit {
        poses: Port::open(launch)?,
        newest: None,
        published: None,
        resume_at: None,
    };
    let scans = Writer::open(&launch.node, &launch.manifest)?;
    let mut playback = Playback {
        launch,
        source,
        credit,
        scans,
        counters: StageCounters::default(),
    };
    if let Some(position) = playback.wait_for_start()? {
        playback.play(position)?;
    }
    Ok(playback.counters)
}

/// The progress of the run, from its poses.
struct Credit {
    poses: Port<Pose>,
    /// Sequence number of the newest pose.
    newest: Option<u64>,
    /// The same at the source.
    published: Option<u64>,
    /// The newest pose of the trajectory at the last start of the sink.
    resume_at: Option<Item>,
}

impl Credit {
    fn update(&mut self) -> Result<(), StageError> {
        while let Some(pose) = self.poses.receive()? {
            let item = pose.item();
            if item.is(flag::SYNC) {
                self.resume_at = Some(*item);
            }
            if !item.is(flag::BASE) && !item.is(flag::END) {
                self.newest = self.newest.max(Some(item.seq));
                self.published = self.published.max(Some(item.published));
            }
        }
        Ok(())
    }
}

struct Playback<'a, S: Source> {
    launch: &'a Launch,
    source: &'a mut S,
    credit: Credit,
    scans: Writer<Scan>,
    counters: StageCounters,
}

impl<S: Source> Playback<'_, S> {
    /// Waits until the sink has reported the newest pose; `None` on a request to stop.
    fn wait_for_start(&mut self) -> Result<Option<Position>, StageError> {
        loop {
            // Sleep first. The sink republishes its last poses one by one and notifies after all of them. Reading earlier
            // could take an older pose for the newest, and more scans would be sent than the readers have room for.
            if self.sleep(wake::MAX_WAIT)? {
                return Ok(None);
            }
            self.credit.update()?;
            if let Some(newest_pose) = self.credit.resume_at {
                // In live mode the numbers do not tell how far back the previous scan is; masking does without it.
                let manifest = &self.launch.manifest;
                let masks_pairs = manifest.window.masks_pairs() && !manifest.live;
                return Ok(Some(Position::resume(&newest_pose, masks_pairs)));
            }
        }
    }

    fn play(&mut self, mut position: Position) -> Result<(), StageError> {
        let (live, rate) = (self.launch.manifest.live, self.launch.manifest.rate);
        let mut pace = None;
        while let Some(mut draft) = self.next_readable(&mut position)? {
            let complete_ns = complete_ns(draft.header());
            if pace.is_none() {
                pace = rate.map(|rate| Pace::new(rate, complete_ns));
            }
            if let Some(pace) = pace
                .as_mut()
                .filter(|_| live && !self.source.drops_missed_scans())
            {
                self.counters.slipped_ns += pace.slip(complete_ns);
            }
            let due_ns = pace.map(|pace| pace.due_ns(complete_ns));
            if !self.admit(draft, &position, due_ns)? {
                return Ok(());
            }
            position.advance();
            if let Some(pace) = pace {
                if live && self.source.drops_missed_scans() {
                    self.drop_missed(&mut position, pace);
                }
                if !self.yield_processors(&position, pace)? {
                    return Ok(());
                }
            }
        }
        if self.wait_for_admission(position.published, None)? {
            self.end(&position)?;
            while !self.sleep(wake::MAX_WAIT)? {}
        }
        Ok(())
    }

    /// Reads the next scan into shared memory before it is due. `None` at the end of the recording.
    fn next_readable(
        &mut self,
        position: &mut Position,
    ) -> Result<Option<Draft<Scan>>, StageError> {
        let mut draft = self.scans.loan()?;
        while position.index < self.source.len() {
            let (started_ns, allocated) = (clock::now_ns(), allocations::so_far());
            let (header, bytes) = draft.parts();
            match self.source.read(position.index, header, bytes) {
                Ok(()) => {
                    let finished_ns = clock::now_ns();
                    self.counters
                        .record(allocations::so_far() - allocated, finished_ns - started_ns);
                    header.item = Item {
                        stamp_ns: header.item.stamp_ns,
                        ..position.item()
                    };
                    *header.item.hop(StageId::RadarReplay) = Hop {
                        received_ns: started_ns,
                        started_ns,
                        finished_ns,
                        published_ns: 0,
                    };
                    return Ok(Some(draft));
                }
                Err(reason) => {
                    self.counters.unreadable += 1;
                    tracing::warn!(scan = position.index, "skipped: {reason}");
                    position.index += 1;
                }
            }
        }
        Ok(None)
    }

    /// Publishes a scan once it is admitted and due; false on a request to stop.
    fn admit(
        &mut self,
        mut draft: Draft<Scan>,
        position: &Position,
        due_ns: Option<i64>,
    ) -> Result<bool, StageError> {
        let admitted = self.wait_for_admission(position.published, due_ns)?;
        if admitted {
            draft.header().item.due_ns = due_ns.unwrap_or_else(clock::now_ns);
            self.scans.send(draft, StageId::RadarReplay)?;
        }
        Ok(admitted)
    }

    /// Waits until the window admits item `seq` and it is due; false on a request to stop.
    fn wait_for_admission(&mut self, seq: u64, due_ns: Option<i64>) -> Result<bool, StageError> {
        let (live, window) = (self.launch.manifest.live, self.launch.manifest.window);
        loop {
            self.credit.update()?;
            let wait = due_ns.map_or(Duration::ZERO, clock::until);
            let has_credit = live || window.admits(seq, self.credit.newest);
            if has_credit && wait.is_zero() {
                return Ok(true);
            }
            let limit = if has_credit {
                wait.min(wake::MAX_WAIT)
            } else {
                wake::MAX_WAIT
            };
            if self.sleep(limit)? {
                return Ok(false);
            }
        }
    }

    /// Drops the scans that a sensor would have measured while this process was down.
    fn drop_missed(&mut self, position: &mut Position, pace: Pace) {
        let now_ns = clock::now_ns();
        let next_is_due = |index| Some(pace.due_ns(self.source.complete_ns(index + 1)?) < now_ns);
        while position.index + 1 < self.source.len() && next_is_due(position.index) == Some(true) {
            position.drop_scan();
        }
    }

    /// Leaves the processors to the scan in flight, since a real sensor would not use them to read a recording. Returns at that
    /// scan's pose, or half-way to the next scan; false on a request to stop.
    fn yield_processors(&mut self, position: &Position, pace: Pace) -> Result<bool, StageError> {
        let Some(complete_ns) = self.source.complete_ns(position.index) else {
            return Ok(true);
        };
        let until_ns =
            clock::now_ns() + (clock::until(pace.due_ns(complete_ns)) / 2).as_nanos() as i64;
        let in_flight = position.published.saturating_sub(1);
        loop {
            self.credit.update()?;
            let wait = clock::until(until_ns);
            if wait.is_zero() || self.credit.published >= Some(in_flight) {
                return Ok(true);
            }
            if self.sleep(wait.min(wake::MAX_WAIT))? {
                return Ok(false);
            }
        }
    }

    fn end(&mut self, position: &Position) -> Result<(), StageError> {
        let mut draft = self.scans.loan()?;
        draft.header().item = Item {
            flags: flag::END,
            ..position.item()
        };
        self.scans.send(draft, StageId::RadarReplay)
    }

    /// Sleeps, and answers the handshakes of new readers; true on a request to stop.
    fn sleep(&mut self, limit: Duration) -> Result<bool, StageError> {
        let woken = self.launch.signals.wait(
            &[self.credit.poses.listener()],
            Some(self.scans.listener()),
            limit,
        )?;
        self.counters.wakes += 1;
        if woken.may_have_new_readers() {
            self.scans.accept_readers()?;
        }
        Ok(woken.stop)
    }
}

/// Returns when the sweep was complete on the sensor's clock: the time of its last azimuth.
fn complete_ns(header: &ScanHeader) -> i64 {
    let stamps = header
        .azimuth_stamp_ns
        .iter()
        .take(header.azimuths as usize);
    stamps.copied().max().unwrap_or(header.item.stamp_ns)
}
