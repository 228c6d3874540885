//! Live mode: the newest scan wins. The scans that are admitted get consecutive numbers, so that no later stage drops any; the
//! gaps in the source's own count are the scans that were dropped.

use std::collections::VecDeque;

use gyre_messages::{Item, Scan, Window, flag};
use gyre_stage::{
    Launch, Listener, StageError,
    inputs::Turn,
    reader::{Port, Received},
};

use crate::scans::looks_at_two;

/// The queue of a live masking stage.
pub struct NewestWins {
    port: Port<Scan>,
    /// The current scan and, behind it, those that came since; at the start the source's history.
    queue: VecDeque<Received<Scan>>,
    /// The scan before, where the mask looks at two.
    before: Option<Received<Scan>>,
    window: Window,
    chain: Option<Chain>,
}

/// The state of the numbering.
#[derive(Clone, Copy)]
struct Chain {
    next: u64,
    previous_scan: Option<u64>,
    /// The source's count at the scan before: a restarted source repeats what it had sent after the last pose.
    published: Option<u64>,
    /// The scan in front was processed before the restart; the others need it again as the scan before.
    repeats: bool,
}

impl NewestWins {
    pub fn open(launch: &Launch) -> Result<Self, StageError> {
        let window = launch.manifest.window;
        Ok(Self {
            port: Port::open(launch)?,
            queue: VecDeque::with_capacity(window.live_depth + 2),
            before: None,
            window,
            chain: None,
        })
    }

    /// Takes what has come.
    pub fn take(&mut self) -> Result<(), StageError> {
        while let Some(received) = self.port.receive()? {
            if self
                .chain
                .is_some_and(|chain| chain.has_passed(received.item()))
            {
                continue;
            }
            self.queue.push_back(received);
            if self.chain.is_some_and(|chain| !chain.repeats) {
                self.drop_all_but_the_newest();
            }
        }
        Ok(())
    }

    /// What to do with the current scan, where the trajectory stands at `sync`.
    pub fn turn(&mut self, sync: &Item, newest_pose: Option<u64>) -> Result<Turn, StageError> {
        let Some(chain) = self.chain.or_else(|| self.resume(sync)) else {
            return Ok(Turn::Wait);
        };
        self.chain = Some(chain);
        if !chain.repeats {
            self.drop_all_but_the_newest();
        }
        let Some(front) = self.queue.front() else {
            return Ok(Turn::Wait);
        };
        let item = chain.number(front.item());
        Ok(match () {
            // The end of the stream takes a place in every history as any item does, so it waits for credit too.
            () if !self.window.admits(item.seq, newest_pose) => Turn::Wait,
            () if item.is(flag::END) => Turn::End(item),
            () => Turn::Process(item, front.received_ns),
        })
    }

    /// Resumes the chain after a start; `None` while only scans from before the last pose's have come: a source that was
    /// restarted too repeats them, and the history of one that was not begins with them.
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

    /// Steps to the next scan.
    pub fn advance(&mut self) {
        let done = self.queue.pop_front();
        if let (Some(chain), Some(done)) = (&mut self.chain, &done) {
            let (scan, published) = (done.item().scan, done.item().published);
            let next = chain.next.saturating_add(1);
            *chain = Chain {
                next,
                previous_scan: Some(scan),
                published: Some(published),
                repeats: false,
            };
        }
        self.keep(done);
    }

    /// The current scan, once it has been taken.
    pub fn current(&self) -> Option<&Received<Scan>> {
        self.queue.front()
    }

    /// What the source notifies.
    pub fn listener(&self) -> &Listener {
        self.port.listener()
    }

    /// The scan that the current one follows. The source may have lost it when all stages were restarted; then the scan is
    /// masked as at the start of a chain.
    pub fn before(&self) -> Option<&Received<Scan>> {
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

    /// Resumes with the last pose's scan if the source still has it, else with a break.
    fn resume(front: &Item, sync: &Item) -> Self {
        match () {
            () if sync.is(flag::BASE) => Self {
                next: 0,
                previous_scan: None,
                published: None,
                repeats: false,
            },
            () if front.published == sync.published && !front.is(flag::END) => Self {
                next: sync.seq,
                previous_scan: Some(sync.previous_scan),
                published: None,
                repeats: true,
            },
            () => Self {
                next: sync.seq.saturating_add(1),
                previous_scan: None,
                published: None,
                repeats: false,
            },
        }
    }

    fn has_passed(&self, item: &Item) -> bool {
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
    fn a_resumed_chain_repeats_the_last_poses_scan_under_its_number() {
        let item = Chain::resume(&scan(31), &sync()).number(&scan(31));
        assert_eq!(
            (item.seq, item.scan, item.previous_scan, item.flags),
            (9, 40, 37, 0)
        );
    }

    #[test]
    fn a_chain_whose_last_scan_is_gone_starts_again_with_the_next_number() {
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
