//! Playing: which scan is next, when it is due, and when the window admits it.

use std::{mem, time::Duration};

use gyre_messages::{Hop, Scan, ScanHeader};
use gyre_radar::continues;

use super::{
    Credit, Source, Tolerance, Unreadable,
    attempts::{Attempts, PAUSE},
    pace::Pace,
    position::Position,
};
use crate::{
    Launch, StageCounters, StageError, allocations, clock,
    schedule::ScheduleWriter,
    wake,
    writer::{Draft, Writer},
};

/// A source that is being played.
pub(super) struct Playback<'a, S: Source> {
    pub launch: &'a Launch,
    pub source: &'a mut S,
    pub tolerance: &'a Tolerance,
    pub credit: Credit,
    pub scans: Writer<Scan>,
    pub schedule: ScheduleWriter,
    pub counters: StageCounters,
    /// True if readers may have come since the last wait.
    pub may_have_new_readers: bool,
}

/// The next scan of the recording.
enum Next {
    Scan(Draft<Scan>),
    End,
    Stop,
}

/// The result of reading a scan.
enum Read {
    Done,
    Damaged(String),
    Stop,
}

impl<S: Source> Playback<'_, S> {
    /// Waits until the sink has reported the newest pose; `None` on a request to stop.
    pub fn wait_for_start(&mut self) -> Result<Option<Position>, StageError> {
        loop {
            // Sleep first. The sink republishes its last poses one by one and notifies after all of
            // them. Reading earlier could take an older pose for the newest, and more scans would
            // be sent than the readers have room for.
            if self.sleep(wake::MAX_WAIT)? {
                return Ok(None);
            }
            self.credit.update()?;
            if let Some(newest_pose) = self.credit.resume_at {
                // In live mode the numbers do not determine the distance to the previous scan;
                // masking does without it.
                let manifest = &self.launch.manifest;
                let masks_pairs = manifest.window.masks_pairs() && !manifest.live;
                let first = self.source.scans().start;
                return Ok(Some(Position::resume(&newest_pose, first, masks_pairs)));
            }
        }
    }

    pub fn play(&mut self, mut position: Position) -> Result<(), StageError> {
        let mut pace = None;
        let mut before = None;
        loop {
            let mut draft = match self.next_readable(&mut position)? {
                Next::Scan(draft) => draft,
                Next::End => break,
                Next::Stop => return Ok(()),
            };
            let times = Times::of(draft.header());
            let gap = before.filter(|before: &Times| !continues(before.stamp_ns, times.stamp_ns));
            if gap.is_some() {
                position.break_chain();
                position.identify(&mut draft.header().item);
            }
            let due_ns = self.due_ns(&mut pace, gap, &times, position.published)?;
            if !self.admit(draft, &position, due_ns)? {
                return Ok(());
            }
            before = Some(times);
            position.advance();
            if let Some(pace) = pace {
                if self.is_sensor() {
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

    /// Returns when a scan is due; `None` at the highest rate. `gap` has the times of the scan
    /// before a break.
    fn due_ns(
        &mut self,
        pace: &mut Option<Pace>,
        gap: Option<Times>,
        times: &Times,
        published: u64,
    ) -> Result<Option<i64>, StageError> {
        let Some(rate) = self.launch.manifest.rate else {
            return Ok(None);
        };
        let pace = pace.get_or_insert_with(|| {
            let before = self.schedule.origin().filter(|_| self.is_sensor());
            before.map_or_else(
                || Pace::new(rate, times.complete_ns),
                |origin| Pace::resumed(rate, origin),
            )
        });
        if let Some(before) = gap {
            let period_ns = self.source.period_ns();
            pace.resume(before.complete_ns, times.complete_ns, period_ns);
        }
        if self.launch.manifest.live && !self.source.drops_missed_scans() {
            self.counters.slipped_ns += pace.slip(times.complete_ns);
        }
        self.schedule.is_paced_from(pace.origin())?;
        Ok(Some(
            pace.due_ns(self.burst_ns(times.complete_ns, published)),
        ))
    }

    /// Returns whether scans become due independently of this process, as a sensor's do.
    fn is_sensor(&self) -> bool {
        self.launch.manifest.live && self.source.drops_missed_scans()
    }

    /// Returns the time on the sensor's clock when the last scan of a scan's burst is complete.
    fn burst_ns(&self, complete_ns: i64, published: u64) -> i64 {
        let after = self.left_in_burst(published) as i64;
        complete_ns.saturating_add(self.source.period_ns().saturating_mul(after))
    }

    /// Returns the number of scans that follow a scan in its burst.
    fn left_in_burst(&self, published: u64) -> u64 {
        let burst = self.source.burst().get() as u64;
        burst - 1 - published % burst
    }

    /// Reads the next scan into shared memory before it is due.
    fn next_readable(&mut self, position: &mut Position) -> Result<Next, StageError> {
        let mut draft = self.scans.loan()?;
        let mut skipped = 0;
        while position.index < self.source.scans().end {
            match self.read(position, &mut draft)? {
                Read::Done => return Ok(Next::Scan(draft)),
                Read::Stop => return Ok(Next::Stop),
                Read::Damaged(reason) => {
                    self.counters.unreadable += 1;
                    tracing::warn!(scan = position.index, "skipped: {reason}");
                    position.index += 1;
                    skipped += 1;
                    self.require_tolerable(skipped, &reason)?;
                }
            }
        }
        Ok(Next::End)
    }

    /// Reads a scan, and tries again while the input fails.
    fn read(&mut self, position: &Position, draft: &mut Draft<Scan>) -> Result<Read, StageError> {
        let mut attempts = Attempts::new(self.tolerance);
        loop {
            let (started_ns, allocated) = (clock::now_ns(), allocations::so_far());
            self.schedule.due_at(started_ns)?;
            let (header, bytes) = draft.parts();
            match self.source.read(position.index, header, bytes) {
                Ok(()) => {
                    let finished_ns = clock::now_ns();
                    crate::counters::record(
                        &mut self.counters,
                        allocations::so_far() - allocated,
                        finished_ns - started_ns,
                    );
                    position.identify(&mut header.item);
                    *header.item.hop_mut(S::HOP) = Hop {
                        received_ns: started_ns,
                        started_ns,
                        finished_ns,
                        published_ns: 0,
                    };
                    return Ok(Read::Done);
                }
                Err(Unreadable::Damaged(reason)) => return Ok(Read::Damaged(reason)),
                Err(Unreadable::Io(reason)) => attempts.failed(reason)?,
            }
            // Not late until the next attempt: the supervisor need not intervene.
            let next_ns = clock::now_ns() + PAUSE.as_nanos() as i64;
            self.schedule.due_at(next_ns)?;
            if self.sleep(PAUSE)? {
                return Ok(Read::Stop);
            }
        }
    }

    fn require_tolerable(&self, skipped: usize, reason: &str) -> Result<(), StageError> {
        match skipped <= self.tolerance.max_unreadable {
            true => Ok(()),
            false => Err(StageError::Input(format!(
                "{skipped} scans in a row cannot be read, the last because {reason}; source.max_unreadable is {}",
                self.tolerance.max_unreadable
            ))),
        }
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
            self.scans.send(draft, S::HOP)?;
            self.schedule.has_published(position.published)?;
        }
        Ok(admitted)
    }

    /// Waits until the window admits item `seq` and it is due; false on a request to stop.
    fn wait_for_admission(&mut self, seq: u64, due_ns: Option<i64>) -> Result<bool, StageError> {
        let (live, window) = (self.launch.manifest.live, self.launch.manifest.window);
        self.schedule.due_at(due_ns.unwrap_or_else(clock::now_ns))?;
        let mut has_slept = false;
        loop {
            self.credit.update()?;
            let wait = due_ns.map_or(Duration::ZERO, clock::until);
            let has_credit = live || window.admits(seq, self.credit.newest);
            if has_credit && wait.is_zero() && has_slept {
                return Ok(true);
            }
            let limit = if has_credit {
                wait.min(wake::MAX_WAIT)
            } else {
                wake::MAX_WAIT
            };
            // However slowly scans are read, there is time for signals, new readers and a beat.
            if self.sleep(limit)? {
                return Ok(false);
            }
            has_slept = true;
        }
    }

    /// Returns when a scan is expected to be due before it is read; `None` if its time is unknown
    /// or inconsistent with the scan before.
    fn expected_ns(&self, index: usize, published: u64, pace: Pace) -> Option<i64> {
        let before_ns = self.source.complete_ns(index.checked_sub(1)?)?;
        let complete_ns = self.source.complete_ns(index)?;
        let due_ns = || pace.due_ns(self.burst_ns(complete_ns, published));
        continues(before_ns, complete_ns).then(due_ns)
    }

    /// Drops the scans that a sensor would have measured while this process was down: those before
    /// the burst that is due.
    fn drop_missed(&mut self, position: &mut Position, pace: Pace) {
        let (now_ns, end) = (clock::now_ns(), self.source.scans().end);
        let is_missed = |position: &Position| {
            let Position {
                index, published, ..
            } = *position;
            self.expected_ns(index, published, pace)?;
            let next = 1 + self.left_in_burst(published);
            let next_ns = self.expected_ns(index + next as usize, published + next, pace)?;
            Some(next_ns < now_ns)
        };
        while position.index + 1 < end && is_missed(position) == Some(true) {
            position.drop_scan();
        }
    }

    /// Leaves the processors to the scan in flight, since a real sensor would not use them to read
    /// a recording. Returns at that scan's pose, or half-way to the next scan; false on a request
    /// to stop.
    fn yield_processors(&mut self, position: &Position, pace: Pace) -> Result<bool, StageError> {
        let Some(due_ns) = self.expected_ns(position.index, position.published, pace) else {
            return Ok(true);
        };
        self.schedule.due_at(due_ns)?;
        let until_ns = clock::now_ns() + (clock::until(due_ns) / 2).as_nanos() as i64;
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
        draft.header().item = position.end();
        self.scans.send(draft, S::HOP)?;
        self.schedule.has_published(position.published)
    }

    /// Answers the handshakes of new readers, and sleeps; true on a request to stop. In this order,
    /// since the scan that has become due when the sleep ends goes first.
    fn sleep(&mut self, limit: Duration) -> Result<bool, StageError> {
        if mem::take(&mut self.may_have_new_readers) {
            self.scans.accept_readers()?;
        }
        let woken = self.launch.signals.wait(
            &[self.credit.poses.listener()],
            Some(self.scans.listener()),
            limit,
        )?;
        self.counters.wakes += 1;
        self.may_have_new_readers = woken.may_have_new_readers();
        Ok(woken.stop)
    }
}

/// The times of a scan on the sensor's clock.
struct Times {
    stamp_ns: i64,
    /// The time of its last azimuth, when the sweep was complete.
    complete_ns: i64,
}

impl Times {
    fn of(header: &ScanHeader) -> Self {
        Self {
            stamp_ns: header.item.stamp_ns,
            complete_ns: header.span_ns()[1],
        }
    }
}
