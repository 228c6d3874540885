//! What masking waits for: a scan, and the motion that its sweep's distortion is undone with.
//!
//! *Lossless*: scans in order, each once. *Live*: the newest scan wins; what was dropped is the gap in the source's count. Live
//! masking numbers the scans that it admits, so that all that follows is lossless again.

use std::collections::VecDeque;

use gyre_messages::{Item, Scan, SearchedMotion, Window, flag};

use crate::{
    Launch, StageError,
    feedback::Feedback,
    inputs::{Inputs, Turn},
    reader::{Port, Reader, Received},
    services::Listener,
};

/// See the module.
pub struct Scans {
    intake: Intake,
    feedback: Feedback,
    window: Window,
    /// The motion for the scan at hand, and that for the one before.
    motions: [Option<SearchedMotion>; 2],
}

enum Intake {
    Lossless(InOrder),
    Live(NewestWins),
}

/// A scan to mask.
pub struct ScanView<'a> {
    /// The scan.
    pub scan: &'a Received<Scan>,
    /// The motion of the scan `lag` before it; `None` where there was none.
    pub motion: Option<SearchedMotion>,
    /// The scan before, where the run's masks look at two; `None` where the chain starts.
    pub before: Option<ScanBefore<'a>>,
}

/// The scan before the one to mask.
pub struct ScanBefore<'a> {
    /// The scan.
    pub scan: &'a Received<Scan>,
    /// The motion that was its own when it was masked.
    pub motion: Option<SearchedMotion>,
}

impl Inputs for Scans {
    type View<'a> = ScanView<'a>;

    fn open(launch: &Launch) -> Result<Self, StageError> {
        let feedback = Feedback::open(&launch.node)?;
        let window = launch.manifest.window;
        let intake = match launch.manifest.live {
            false => Intake::Lossless(InOrder {
                reader: Reader::open(&launch.node, None)?,
                window,
                flowing: false,
            }),
            true => Intake::Live(NewestWins {
                port: Port::open(&launch.node)?,
                queue: VecDeque::with_capacity(window.live_depth + 2),
                before: None,
                window,
                chain: None,
            }),
        };
        Ok(Self {
            intake,
            feedback,
            window,
            motions: [None; 2],
        })
    }

    fn turn(&mut self) -> Result<Turn, StageError> {
        match &mut self.intake {
            Intake::Lossless(intake) => drop(intake.reader.head()?),
            Intake::Live(intake) => intake.take()?,
        }
        self.feedback.update()?;
        // Where the trajectory stands decides which scans are still wanted, and in live mode where the chain goes on.
        let Some(sync) = self.feedback.sync().copied() else {
            return Ok(Turn::Wait);
        };
        let newest = self.feedback.newest_pose();
        let turn = match &mut self.intake {
            Intake::Lossless(intake) => intake.turn(newest)?,
            Intake::Live(intake) => intake.turn(&sync, newest)?,
        };
        match turn {
            Turn::Process(item, _) if !self.find_motions(item.seq) => Ok(Turn::Wait),
            turn => Ok(turn),
        }
    }

    fn view(&self) -> Option<ScanView<'_>> {
        let (scan, before) = match &self.intake {
            Intake::Lossless(intake) => (intake.reader.current(), intake.before()),
            Intake::Live(intake) => (intake.queue.front(), intake.before()),
        };
        let [motion, motion_before] = self.motions;
        let before = before.map(|scan| ScanBefore {
            scan,
            motion: motion_before,
        });
        Some(ScanView {
            scan: scan?,
            motion,
            before,
        })
    }

    fn advance(&mut self) {
        match &mut self.intake {
            Intake::Lossless(intake) => intake.advance(),
            Intake::Live(intake) => intake.advance(),
        }
    }

    fn listeners(&self) -> Vec<&Listener> {
        let [motions, poses] = self.feedback.listeners();
        let scans = match &self.intake {
            Intake::Lossless(intake) => intake.reader.listener(),
            Intake::Live(intake) => intake.port.listener(),
        };
        vec![scans, motions, poses]
    }

    fn duplicates(&self) -> u64 {
        match &self.intake {
            Intake::Lossless(intake) => intake.reader.duplicates(),
            Intake::Live(_) => 0,
        }
    }
}

impl Scans {
    /// Looks up the motions that scan `seq` and the one before are compensated with; false as long as one is still to come.
    fn find_motions(&mut self, seq: u64) -> bool {
        let before = if looks_at_two(&self.window) {
            seq.checked_sub(1)
        } else {
            None
        };
        let found =
            [Some(seq), before].map(|seq| seq.map_or(Some(None), |seq| self.motion_for(seq)));
        self.motions = found.map(Option::flatten);
        found.iter().all(Option::is_some)
    }

    /// The motion for scan `seq`, by number alone, so that it is the same one after a restart.
    fn motion_for(&self, seq: u64) -> Option<Option<SearchedMotion>> {
        let asked = if self.window.lag == 0 {
            None
        } else {
            seq.checked_sub(self.window.lag as u64)
        };
        asked.map_or(Some(None), |seq| self.feedback.motion(seq))
    }
}

/// Whether a mask needs the scan before: what looks back at it looks back at one more.
fn looks_at_two(window: &Window) -> bool {
    window.look_back > 1
}

/// Whether a starting masking is to send nothing for an item: its readers have had it, or it lacks its own scan before, and what
/// came of it would not be what was sent for it the first time.
fn serves_only_as_before(
    window: &Window,
    item: &Item,
    newest_pose: Option<u64>,
    has_before: bool,
) -> bool {
    let had = newest_pose
        .is_some_and(|newest| item.seq.saturating_add(window.look_back as u64) <= newest);
    had || (looks_at_two(window) && !has_before && !item.is(flag::BREAK))
}

struct InOrder {
    reader: Reader<Scan>,
    window: Window,
    /// From the first scan that was wanted on, none is skipped: that would leave a hole in what we send.
    flowing: bool,
}

impl InOrder {
    fn turn(&mut self, newest_pose: Option<u64>) -> Result<Turn, StageError> {
        let Some(head) = self.reader.head()? else {
            return Ok(Turn::Wait);
        };
        let (item, received_ns) = (*head.item(), head.received_ns);
        if item.is(flag::END) {
            return Ok(Turn::End(item));
        }
        if !self.flowing
            && serves_only_as_before(&self.window, &item, newest_pose, self.before().is_some())
        {
            return Ok(Turn::Keep);
        }
        self.flowing = true;
        Ok(Turn::Process(item, received_ns))
    }

    fn before(&self) -> Option<&Received<Scan>> {
        self.reader.before()
    }

    fn advance(&mut self) {
        match looks_at_two(&self.window) {
            true => self.reader.advance(),
            false => self.reader.release(),
        }
    }
}

struct NewestWins {
    port: Port<Scan>,
    /// The scan at hand and, behind it, what came since; at the start the source's history.
    queue: VecDeque<Received<Scan>>,
    /// The scan before, where masks look at two.
    before: Option<Received<Scan>>,
    window: Window,
    chain: Option<Chain>,
}

/// Where the numbering goes on.
#[derive(Clone, Copy)]
struct Chain {
    next: u64,
    previous_scan: Option<u64>,
    /// The source's count at the scan before: a restarted source sends again what it had sent after the last pose.
    published: Option<u64>,
    /// The scan in front was processed before the restart: the others need it once more, as the one before.
    again: bool,
}

impl NewestWins {
    /// Takes what has come.
    fn take(&mut self) -> Result<(), StageError> {
        while let Some(received) = self.port.receive()? {
            if self.chain.is_some_and(|chain| chain.had(received.item())) {
                continue;
            }
            self.queue.push_back(received);
            if self.chain.is_some_and(|chain| !chain.again) {
                self.drop_all_but_the_newest();
            }
        }
        Ok(())
    }

    fn turn(&mut self, sync: &Item, newest_pose: Option<u64>) -> Result<Turn, StageError> {
        let Some(chain) = self.chain.or_else(|| self.resume(sync)) else {
            return Ok(Turn::Wait);
        };
        self.chain = Some(chain);
        if !chain.again {
            self.drop_all_but_the_newest();
        }
        let Some(front) = self.queue.front() else {
            return Ok(Turn::Wait);
        };
        let item = chain.number(front.item());
        Ok(match () {
            // The end of the stream takes a place in every history as any item does, so it waits for its place too.
            () if !self.window.admits(item.seq, newest_pose) => Turn::Wait,
            () if item.is(flag::END) => Turn::End(item),
            () => Turn::Process(item, front.received_ns),
        })
    }

    /// Where the chain goes on after a start; `None` as long as only scans from before the last pose's have come. A source that was
    /// restarted as well sends them again, and one whose history is just being handed over is not through with them.
    fn resume(&mut self, sync: &Item) -> Option<Chain> {
        while self
            .queue
            .front()
            .is_some_and(|front| Chain::is_past(front.item(), sync))
        {
            let past = self
                .queue
                .pop_front()
                .filter(|past| past.item().scan == sync.previous_scan);
            if past.is_some() {
                self.keep(past);
            }
        }
        Some(Chain::resume(self.queue.front()?.item(), sync))
    }

    fn drop_all_but_the_newest(&mut self) {
        while self.queue.len() > 1 && !self.queue[1].item().is(flag::END) {
            self.queue.pop_front();
        }
    }

    fn advance(&mut self) {
        let done = self.queue.pop_front();
        if let (Some(chain), Some(done)) = (&mut self.chain, &done) {
            let (scan, published) = (done.item().scan, done.item().published);
            let next = chain.next.saturating_add(1);
            *chain = Chain {
                next,
                previous_scan: Some(scan),
                published: Some(published),
                again: false,
            };
        }
        self.keep(done);
    }

    /// The scan that the one at hand follows. The source may have lost it when all were started again; then a mask makes do
    /// without, as it does where the chain starts.
    fn before(&self) -> Option<&Received<Scan>> {
        let previous = self.chain?.previous_scan;
        self.before
            .as_ref()
            .filter(|before| Some(before.item().scan) == previous)
    }

    fn keep(&mut self, done: Option<Received<Scan>>) {
        if looks_at_two(&self.window) {
            self.before = done;
        }
    }
}

impl Chain {
    /// Whether a scan comes before the last pose's.
    fn is_past(item: &Item, sync: &Item) -> bool {
        !sync.is(flag::BASE) && !item.is(flag::END) && item.published < sync.published
    }

    /// Goes on with the last pose's scan if the source still has it, else with a break.
    fn resume(front: &Item, sync: &Item) -> Self {
        match () {
            () if sync.is(flag::BASE) => Self {
                next: 0,
                previous_scan: None,
                published: None,
                again: false,
            },
            () if front.published == sync.published && !front.is(flag::END) => Self {
                next: sync.seq,
                previous_scan: Some(sync.previous_scan),
                published: None,
                again: true,
            },
            () => Self {
                next: sync.seq.saturating_add(1),
                previous_scan: None,
                published: None,
                again: false,
            },
        }
    }

    fn had(&self, item: &Item) -> bool {
        !item.is(flag::END)
            && self
                .published
                .is_some_and(|published| item.published <= published)
    }

    /// The item's place in the chain of motions.
    fn number(&self, item: &Item) -> Item {
        let start = if self.previous_scan.is_none() {
            flag::BREAK
        } else {
            0
        };
        Item {
            seq: self.next,
            previous_scan: self.previous_scan.unwrap_or(item.scan),
            flags: (item.flags & flag::END) | start,
            ..*item
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sync() -> Item {
        Item {
            seq: 9,
            scan: 40,
            previous_scan: 37,
            published: 31,
            ..Item::default()
        }
    }

    fn scan(published: u64) -> Item {
        Item {
            seq: published,
            published,
            scan: published + 9,
            ..Item::default()
        }
    }

    #[test]
    fn a_starting_masking_begins_with_the_last_poses_scan_and_the_scan_before_it_where_masks_look_at_two()
     {
        let window = |look_back| Window {
            scans: 4,
            lag: 2,
            look_back,
            live_depth: 0,
        };
        let kept = |look_back, published, has_before| {
            serves_only_as_before(&window(look_back), &scan(published), Some(9), has_before)
        };
        assert!(kept(1, 8, false) && !kept(1, 9, false));
        assert!(kept(2, 7, true) && kept(2, 8, false) && !kept(2, 9, true));
        let first = Item {
            flags: flag::BREAK,
            ..scan(0)
        };
        assert!(!serves_only_as_before(&window(2), &first, None, false));
    }

    #[test]
    fn the_chain_goes_on_with_the_last_poses_scan_under_its_old_number() {
        let item = Chain::resume(&scan(31), &sync()).number(&scan(31));
        assert_eq!(
            (item.seq, item.scan, item.previous_scan, item.flags),
            (9, 40, 37, 0)
        );
    }

    #[test]
    fn a_chain_whose_last_scan_is_gone_starts_anew_with_the_next_number() {
        let item = Chain::resume(&scan(35), &sync()).number(&scan(35));
        assert_eq!((item.seq, item.previous_scan), (10, item.scan));
        assert!(item.is(flag::BREAK));
    }

    #[test]
    fn scans_from_before_the_last_pose_never_start_a_chain() {
        assert!(Chain::is_past(&scan(30), &sync()) && !Chain::is_past(&scan(31), &sync()));
        assert!(!Chain::is_past(
            &scan(0),
            &Item {
                flags: flag::BASE,
                ..sync()
            }
        ));
        assert!(!Chain::is_past(
            &Item {
                flags: flag::END,
                ..scan(0)
            },
            &sync()
        ));
    }
}
