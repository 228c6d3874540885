//! Playing: which scan is next, when it is due, and when the window admits it.

use gyre_contract::{Scan, run::SourceConfig};
use gyre_geometry::continues;
use gyre_transport::{RunError, clock, wake, writer::Draft};

use super::{Attempts, Feed, PAUSE, Source, Unreadable, hop, pace::Pace, position::Position};
use crate::counters::Work;

pub(super) struct Playback<'a, S: Source> {
    pub feed: Feed<'a, Scan>,
    pub source: &'a mut S,
    pub config: &'a SourceConfig,
}

impl<S: Source> Playback<'_, S> {
    pub fn play(&mut self) -> Result<(), RunError> {
        let newest_pose = self.feed.wait_for_start()?;
        // In live mode the numbers do not determine the distance to the previous scan; masking does
        // without it.
        let manifest = &self.feed.launch.manifest;
        let live = manifest.live;
        let masks_pairs = manifest.window.masks_pairs() && !live;
        let first = self.source.scans().start;
        let mut position = Position::resume(&newest_pose, first, masks_pairs);
        let mut pace = None;
        let mut before: Option<(i64, i64)> = None;
        while let Some(mut draft) = self.next_readable(&mut position)? {
            let header = draft.header();
            let (stamp_ns, complete_ns) = (header.item.stamp_ns, header.span_ns()[1]);
            let gap = before.filter(|(before_ns, _)| !continues(*before_ns, stamp_ns));
            if gap.is_some() {
                position.break_chain();
                position.identify(&mut header.item);
            }
            let gap_ns = gap.map(|(_, before_ns)| before_ns);
            let due_ns = self.due_ns(&mut pace, gap_ns, complete_ns, position.published)?;
            self.feed
                .wait_for_admission(position.published, due_ns, live)?;
            draft.header().item.due_ns = due_ns.unwrap_or_else(clock::now_ns);
            self.feed.scans().send(draft, S::HOP)?;
            self.feed.schedule.has_published(position.published)?;
            before = Some((stamp_ns, complete_ns));
            position.advance();
            if let Some(pace) = pace {
                if self.is_sensor() {
                    self.drop_missed(&mut position, pace);
                }
                self.yield_processors(&position, pace)?;
            }
        }
        self.feed
            .wait_for_admission(position.published, None, live)?;
        self.feed.end(position.item())?;
        loop {
            self.feed.sleep(wake::MAX_WAIT)?;
        }
    }

    /// Returns when a scan is due that is complete at `complete_ns` of the sensor's clock; `None`
    /// at the highest rate. `gap_ns`: when the scan before a break was complete.
    fn due_ns(
        &mut self,
        pace: &mut Option<Pace>,
        gap_ns: Option<i64>,
        complete_ns: i64,
        published: u64,
    ) -> Result<Option<i64>, RunError> {
        let Some(rate) = self.feed.launch.manifest.rate else {
            return Ok(None);
        };
        let pace = pace.get_or_insert_with(|| {
            let before = self.feed.schedule.origin.filter(|_| self.is_sensor());
            let origin = before.unwrap_or_else(|| (clock::now_ns(), complete_ns));
            Pace { rate, origin }
        });
        if let Some(before_ns) = gap_ns {
            pace.resume(before_ns, complete_ns, self.source.period_ns());
        }
        if self.feed.launch.manifest.live && !self.source.drops_missed_scans() {
            self.feed.counters.slipped_ns += pace.slip(complete_ns);
        }
        self.feed.schedule.is_paced_from(pace.origin)?;
        let burst_ns = self.burst_ns(complete_ns, published);
        Ok(Some(pace.due_ns(burst_ns)))
    }

    /// Returns whether scans become due independently of this process, as a sensor's do.
    fn is_sensor(&self) -> bool {
        self.feed.launch.manifest.live && self.source.drops_missed_scans()
    }

    /// Returns the time on the sensor's clock when the last scan of a scan's burst is complete.
    fn burst_ns(&self, complete_ns: i64, published: u64) -> i64 {
        let after = self.left_in_burst(published) as i64;
        complete_ns.saturating_add(self.source.period_ns().saturating_mul(after))
    }

    fn left_in_burst(&self, published: u64) -> u64 {
        let burst = self.source.burst().get() as u64;
        burst - 1 - published % burst
    }

    /// Reads the next scan into shared memory before it is due; `None` at the end.
    fn next_readable(&mut self, position: &mut Position) -> Result<Option<Draft<Scan>>, RunError> {
        let mut draft = self.feed.scans().loan()?;
        let mut skipped = 0;
        while position.index < self.source.scans().end {
            let Some(reason) = self.read(position, &mut draft)? else {
                return Ok(Some(draft));
            };
            self.feed.counters.unreadable += 1;
            tracing::warn!(scan = position.index, "skipped: {reason}");
            position.index += 1;
            skipped += 1;
            let most = self.config.max_unreadable;
            if skipped > most {
                return Err(RunError::Input(format!(
                    "{skipped} scans in a row cannot be read, the last because {reason}; source.max_unreadable is {most}"
                )));
            }
        }
        Ok(None)
    }

    /// Reads a scan, and tries again while the input fails. Returns why it is damaged.
    fn read(
        &mut self,
        position: &Position,
        draft: &mut Draft<Scan>,
    ) -> Result<Option<String>, RunError> {
        let mut attempts = Attempts::new(self.config);
        loop {
            let work = Work::begin();
            self.feed.schedule.due_at(work.started_ns)?;
            let (header, bytes) = draft.parts();
            match self.source.read(position.index, header, bytes) {
                Ok(()) => {
                    let finished_ns = work.end(&mut self.feed.counters);
                    position.identify(&mut header.item);
                    *header.item.hop_mut(S::HOP) = hop(work.started_ns, finished_ns);
                    return Ok(None);
                }
                Err(Unreadable::Damaged(reason)) => return Ok(Some(reason)),
                Err(Unreadable::Io(reason)) => attempts.failed(reason)?,
            }
            // Not late until the next attempt: the supervisor need not intervene.
            let next_ns = clock::now_ns() + PAUSE.as_nanos() as i64;
            self.feed.schedule.due_at(next_ns)?;
            self.feed.sleep(PAUSE)?;
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
    /// a recording. Returns at that scan's pose, or half-way to the next scan.
    fn yield_processors(&mut self, position: &Position, pace: Pace) -> Result<(), RunError> {
        let Some(due_ns) = self.expected_ns(position.index, position.published, pace) else {
            return Ok(());
        };
        self.feed.schedule.due_at(due_ns)?;
        let until_ns = clock::now_ns() + (clock::until(due_ns) / 2).as_nanos() as i64;
        let in_flight = position.published.saturating_sub(1);
        loop {
            self.feed.credit.update()?;
            let wait = clock::until(until_ns);
            if wait.is_zero() || self.feed.credit.published >= Some(in_flight) {
                return Ok(());
            }
            self.feed.sleep(wait)?;
        }
    }
}
