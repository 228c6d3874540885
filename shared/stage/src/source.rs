//! The loop of the first stage: it admits a scan when the window has room and, if so told, when its time has come.

use std::time::Duration;

use gyre_messages::{Hop, Item, Pose, Scan, ScanHeader, StageId, flag};

use crate::{
    Launch, StageCounters, StageError, allocations, clock,
    reader::Port,
    wake,
    writer::{Draft, Writer},
};

/// What has scans to give, by number from 0.
pub trait Source {
    /// How many there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// When scan `index` is complete on the sensor's clock, ns since 1970, as far as can be told without reading it. Where it
    /// cannot, live mode does not know which scans a source that was away has missed, and plays them late.
    fn complete_ns(&self, index: usize) -> Option<i64>;

    /// Whether scans pass by in live mode while this process is busy or away, as a radar's do.
    fn passes_by(&self) -> bool;

    /// Reads scan `index` into shared memory; the error is one sentence that says why it cannot be used.
    fn read(
        &mut self,
        index: usize,
        header: &mut ScanHeader,
        bytes: &mut [u8],
    ) -> Result<(), String>;
}

/// Runs the source until SIGTERM.
pub fn run(launch: &Launch, source: &mut impl Source) -> Result<StageCounters, StageError> {
    let credit = Credit {
        poses: Port::open(launch)?,
        newest: None,
        published: None,
        sync: None,
    };
    let scans = Writer::open(&launch.node, &launch.manifest)?;
    let mut playback = Playback {
        launch,
        source,
        credit,
        scans,
        counters: StageCounters::default(),
    };
    let Some(position) = playback.wait_for_start()? else {
        return Ok(playback.counters);
    };
    playback.play(position)?;
    Ok(playback.counters)
}

/// What the poses say: how far the run is.
struct Credit {
    poses: Port<Pose>,
    newest: Option<u64>,
    /// The newest pose's number among the scans published.
    published: Option<u64>,
    sync: Option<Item>,
}

impl Credit {
    fn update(&mut self) -> Result<(), StageError> {
        while let Some(pose) = self.poses.receive()? {
            let item = pose.item();
            if item.is(flag::SYNC) {
                self.sync = Some(*item);
            }
            if !item.is(flag::BASE) && !item.is(flag::END) {
                self.newest = self.newest.max(Some(item.seq));
                self.published = self.published.max(Some(item.published));
            }
        }
        Ok(())
    }
}

/// Where playing goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Position {
    /// The next scan to read.
    index: usize,
    /// Its number among those published. In live mode that is not its number in the chain, which masking gives.
    published: u64,
    /// The scan published before it.
    previous: Option<u64>,
}

impl Position {
    /// Starts at the last pose's scan, or the one before it where a mask looks at two: the others need them as the ones before.
    fn resume(sync: &Item, look_back: usize) -> Self {
        if sync.is(flag::BASE) || (look_back > 1 && sync.published == 0) {
            return Self::default();
        }
        match look_back > 1 && !sync.is(flag::BREAK) {
            true => Self {
                index: sync.previous_scan as usize,
                published: sync.published - 1,
                previous: None,
            },
            false => Self {
                index: sync.scan as usize,
                published: sync.published,
                previous: (!sync.is(flag::BREAK)).then_some(sync.previous_scan),
            },
        }
    }

    fn advance(&mut self) {
        self.previous = Some(self.index as u64);
        self.miss();
    }

    /// The sensor has seen this one, but nobody will.
    fn miss(&mut self) {
        self.index += 1;
        self.published = self.published.saturating_add(1);
    }

    fn item(&self) -> Item {
        // A resumed chain is not broken: its first item is one that the others have had.
        let start = if self.published == 0 { flag::BREAK } else { 0 };
        let scan = self.index as u64;
        Item {
            seq: self.published,
            published: self.published,
            scan,
            previous_scan: self.previous.unwrap_or(scan),
            flags: start,
            ..Item::default()
        }
    }
}

struct Playback<'a, S: Source> {
    launch: &'a Launch,
    source: &'a mut S,
    credit: Credit,
    scans: Writer<Scan>,
    counters: StageCounters,
}

/// A scan's time, sensor to run: `due = start + (complete - first) / rate`.
#[derive(Clone, Copy)]
struct Tempo {
    rate: f64,
    start_ns: i64,
    first_ns: i64,
}

impl Tempo {
    /// Moves on to now where a scan is late already; returns by how much, ns.
    fn slip(&mut self, complete_ns: i64) -> u64 {
        let late_ns = clock::now_ns()
            .saturating_sub(self.due_ns(complete_ns))
            .max(0);
        self.start_ns = self.start_ns.saturating_add(late_ns);
        late_ns as u64
    }

    fn due_ns(&self, complete_ns: i64) -> i64 {
        self.start_ns
            .saturating_add((complete_ns.saturating_sub(self.first_ns) as f64 / self.rate) as i64)
    }
}

impl<S: Source> Playback<'_, S> {
    /// Waits until the trajectory's keeper has said where it stands; `None` when told to stop before that.
    fn wait_for_start(&mut self) -> Result<Option<Position>, StageError> {
        loop {
            // Sleep first: the keeper hands over its last poses one by one and wakes us when all are there. Who looks earlier
            // can take one of them for the last, and then sends more than its readers have room for.
            if self.sleep(wake::MAX_WAIT)? {
                return Ok(None);
            }
            self.credit.update()?;
            if let Some(sync) = self.credit.sync {
                // In live mode numbers do not tell how far back the scan before is; masking does without.
                let look_back = if self.launch.manifest.live {
                    1
                } else {
                    self.launch.manifest.window.look_back
                };
                return Ok(Some(Position::resume(&sync, look_back)));
            }
        }
    }

    fn play(&mut self, mut position: Position) -> Result<(), StageError> {
        let mut tempo = None;
        while let Some(mut draft) = self.next_readable(&mut position)? {
            let complete_ns = complete_ns(draft.header());
            let tempo = tempo.get_or_insert_with(|| self.tempo(complete_ns));
            if let Some(tempo) = tempo
                .as_mut()
                .filter(|_| self.launch.manifest.live && !self.source.passes_by())
            {
                self.counters.slipped_ns += tempo.slip(complete_ns);
            }
            if !self.admit(
                draft,
                &position,
                tempo.map(|tempo| tempo.due_ns(complete_ns)),
            )? {
                return Ok(());
            }
            position.advance();
            if let Some(tempo) = *tempo {
                if self.launch.manifest.live && self.source.passes_by() {
                    self.skip_what_is_past(&mut position, tempo);
                }
                if !self.let_pass(&position, tempo)? {
                    return Ok(());
                }
            }
        }
        if self.wait_for_turn(position.published, None)? {
            self.end(&position)?;
            while !self.sleep(wake::MAX_WAIT)? {}
        }
        Ok(())
    }

    /// Reads ahead: the next scan is in shared memory before it is asked for. `None` at the end of the recording.
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
                    let stamp_ns = header.item.stamp_ns;
                    header.item = Item {
                        stamp_ns,
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

    /// Publishes a scan when there is room and its time has come; false when told to stop before that.
    fn admit(
        &mut self,
        mut draft: Draft<Scan>,
        position: &Position,
        due_ns: Option<i64>,
    ) -> Result<bool, StageError> {
        let turn = self.wait_for_turn(position.published, due_ns)?;
        if turn {
            draft.header().item.due_ns = due_ns.unwrap_or_else(clock::now_ns);
            self.scans.send(draft, StageId::RadarReplay)?;
        }
        Ok(turn)
    }

    /// Waits until the window has room for item `seq` and its time has come; false when told to stop before that.
    fn wait_for_turn(&mut self, seq: u64, due_ns: Option<i64>) -> Result<bool, StageError> {
        let (live, window) = (self.launch.manifest.live, self.launch.manifest.window);
        loop {
            self.credit.update()?;
            let wait = due_ns.map_or(Duration::ZERO, clock::until);
            let room = live || window.admits(seq, self.credit.newest);
            if room && wait.is_zero() {
                return Ok(true);
            }
            let limit = if room {
                wait.min(wake::MAX_WAIT)
            } else {
                wake::MAX_WAIT
            };
            if self.sleep(limit)? {
                return Ok(false);
            }
        }
    }

    /// A radar does not wait: what it saw while this process was not there has been missed.
    fn skip_what_is_past(&mut self, position: &mut Position, tempo: Tempo) {
        let now_ns = clock::now_ns();
        let period_behind =
            |index| Some(tempo.due_ns(self.source.complete_ns(index + 1)?) < now_ns);
        while position.index + 1 < self.source.len() && period_behind(position.index) == Some(true)
        {
            position.miss();
        }
    }

    /// Reading a recording is work that a radar does not make: while there is time, leave the processors to the scan on its way.
    /// Returns at its pose, or half-way to the next scan; false when told to stop before that.
    fn let_pass(&mut self, position: &Position, tempo: Tempo) -> Result<bool, StageError> {
        let Some(complete_ns) = self.source.complete_ns(position.index) else {
            return Ok(true);
        };
        let until_ns =
            clock::now_ns() + (clock::until(tempo.due_ns(complete_ns)) / 2).as_nanos() as i64;
        let sent = position.published.saturating_sub(1);
        loop {
            self.credit.update()?;
            let wait = clock::until(until_ns);
            if wait.is_zero() || self.credit.published >= Some(sent) {
                return Ok(true);
            }
            if self.sleep(wait.min(wake::MAX_WAIT))? {
                return Ok(false);
            }
        }
    }

    /// The pace from a first scan on; `None`: as fast as the window admits.
    fn tempo(&self, first_ns: i64) -> Option<Tempo> {
        Some(Tempo {
            rate: self.launch.manifest.rate?,
            start_ns: clock::now_ns(),
            first_ns,
        })
    }

    fn end(&mut self, position: &Position) -> Result<(), StageError> {
        let mut draft = self.scans.loan()?;
        draft.header().item = Item {
            flags: flag::END,
            ..position.item()
        };
        self.scans.send(draft, StageId::RadarReplay)
    }

    /// Sleeps, and answers readers that have come; true when told to stop.
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

/// When the sweep was complete on the sensor's clock: the time of its last azimuth.
fn complete_ns(header: &ScanHeader) -> i64 {
    let stamps = header
        .azimuth_stamp_ns
        .iter()
        .take(header.azimuths as usize);
    stamps.copied().max().unwrap_or(header.item.stamp_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_restart_begins_with_the_last_poses_scan() {
        let sync = Item {
            seq: 9,
            published: 9,
            scan: 12,
            previous_scan: 10,
            ..Item::default()
        };
        assert_eq!(
            Position::resume(&sync, 1),
            Position {
                index: 12,
                published: 9,
                previous: Some(10)
            }
        );
        assert_eq!(
            Position::resume(&sync, 2),
            Position {
                index: 10,
                published: 8,
                previous: None
            }
        );
        let base = Item {
            flags: flag::BASE,
            ..sync
        };
        assert_eq!(Position::resume(&base, 1), Position::default());
    }

    #[test]
    fn a_restart_in_live_mode_goes_on_with_the_sources_own_count() {
        let sync = Item {
            seq: 9,
            published: 31,
            scan: 40,
            previous_scan: 37,
            ..Item::default()
        };
        let position = Position::resume(&sync, 1);
        assert_eq!((position.index, position.item().published), (40, 31));
    }

    #[test]
    fn only_the_very_first_scan_starts_a_chain() {
        assert!(Position::default().item().is(flag::BREAK));
        assert!(
            !Position {
                index: 12,
                published: 9,
                previous: None
            }
            .item()
            .is(flag::BREAK)
        );
    }

    #[test]
    fn tempo_stretches_the_sensors_clock() {
        let tempo = Tempo {
            rate: 4.0,
            start_ns: 1000,
            first_ns: 500,
        };
        assert_eq!(tempo.due_ns(500 + 4000), 2000);
    }

    #[test]
    fn tempo_slips_by_what_a_scan_is_late_and_by_no_more() {
        let start_ns = clock::now_ns() - 1_000_000_000;
        let mut tempo = Tempo {
            rate: 1.0,
            start_ns,
            first_ns: 0,
        };
        assert!(tempo.slip(500_000_000) >= 500_000_000);
        assert!(tempo.due_ns(500_000_000) <= clock::now_ns());
        assert_eq!(tempo.slip(10_000_000_000), 0);
    }
}
