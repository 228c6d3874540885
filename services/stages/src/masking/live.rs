//! Live mode: only the newest scan is processed. Admitted scans get consecutive sequence numbers;
//! the gaps in the source's own count are the dropped scans. After a start scans are processed in
//! order until masking has caught up, and as many may wait as the window has room for: so a restart
//! that is shorter than that drops none of those that came meanwhile.

use std::{collections::VecDeque, mem};

use gyre_contract::{Item, NumberedBy, Scan, Window, flag};
use gyre_geometry::{continues, samples::Sample};
use gyre_stage::{Launch, inputs::Action};
use gyre_transport::{
    Generation, Listener, Manifest, RunError,
    reader::{Port, Received},
};

use crate::masking::lossless::Queue;

/// Windows of scans after which masking counts as caught up all the same: a pipeline that is slower
/// than its scans never is, and would have the latency of those that wait for ever.
const WINDOWS_IN_ORDER: usize = 8;

pub struct NewestOnly {
    port: Port<Scan>,
    /// The current scan and the ones received since; at the start, the history of the source.
    queue: VecDeque<Received<Scan>>,
    previous: Option<Received<Scan>>,
    window: Window,
    /// The run, where the generation and its numbers begin together.
    manifest: Manifest,
    chain: Option<Chain>,
    /// Scans that may still be processed in order after a start; 0: the newest scan alone.
    in_order: usize,
    dropped: Vec<Sample>,
}

#[derive(Clone, Copy)]
struct Chain {
    next: u64,
    generation: Generation,
    previous_scan: Option<u64>,
    previous_ns: Option<i64>,
    /// The source's count at the previous scan: a restarted source repeats the scans after the
    /// newest pose.
    published: Option<u64>,
    /// True if the current scan was processed before the restart: the other stages need it again as
    /// their previous scan.
    repeats: bool,
}

impl NewestOnly {
    pub fn open(launch: &Launch) -> Result<Self, RunError> {
        let window = launch.manifest.window;
        Ok(Self {
            port: launch.port()?,
            queue: VecDeque::with_capacity(window.live_depth + 2),
            previous: None,
            window,
            manifest: launch.manifest.clone(),
            chain: None,
            in_order: window.scans * WINDOWS_IN_ORDER,
            dropped: Vec::new(),
        })
    }

    /// Resumes the chain after a start. `None` while all received scans precede the newest pose: a
    /// restarted source repeats such scans, and the history of a running source begins with them.
    fn resume(&mut self, newest_pose: &Item) -> Result<Option<Chain>, RunError> {
        while self
            .queue
            .front()
            .is_some_and(|front| Chain::precedes(front.item(), newest_pose))
        {
            let past = self
                .queue
                .pop_front()
                .filter(|past| past.item().scan == newest_pose.previous_scan);
            if past.is_some() {
                self.keep(past);
            }
        }
        let Some(front) = self.queue.front() else {
            return Ok(None);
        };
        let first = match newest_pose.is(flag::BASE) {
            true => 0,
            false => newest_pose.seq.saturating_add(1),
        };
        let generation =
            Generation::begin(&self.manifest, NumberedBy::Masking, newest_pose, first)?;
        Ok(Some(Chain {
            generation,
            ..Chain::resume(front.item(), newest_pose)
        }))
    }

    /// Drops all but the newest scan; until masking has caught up after a start, all but as many as
    /// the window has room for.
    fn drop_the_oldest(&mut self) {
        let room = match self.in_order {
            0 => 1,
            _ => self.window.scans,
        };
        while self.scans() > room {
            let dropped = self.queue.pop_front();
            let samples = dropped
                .as_ref()
                .and_then(|scan| scan.header().samples(scan.values()));
            self.dropped.extend_from_slice(samples.unwrap_or_default());
        }
    }

    fn scans(&self) -> usize {
        let is_end = |last: &Received<Scan>| last.item().is(flag::END);
        self.queue.len() - usize::from(self.queue.back().is_some_and(is_end))
    }

    fn keep(&mut self, done: Option<Received<Scan>>) {
        if self.window.masks_pairs() {
            self.previous = done;
        }
    }
}

impl Queue for NewestOnly {
    fn receive(&mut self) -> Result<(), RunError> {
        while let Some(received) = self.port.receive()? {
            if self
                .chain
                .is_some_and(|chain| chain.has_passed(received.item()))
            {
                continue;
            }
            self.queue.push_back(received);
            if self.chain.is_some_and(|chain| !chain.repeats) {
                self.drop_the_oldest();
            }
        }
        let has_begun = self.chain.is_some_and(|chain| chain.published.is_some());
        if has_begun && self.scans() <= 1 {
            self.in_order = 0;
        }
        Ok(())
    }

    fn next_action(
        &mut self,
        resume_at: &Item,
        newest_pose: Option<u64>,
    ) -> Result<Action, RunError> {
        let chain = match self.chain {
            None => self.resume(resume_at)?,
            chain => chain,
        };
        let Some(chain) = chain else {
            return Ok(Action::Wait);
        };
        self.chain = Some(chain);
        if !chain.repeats {
            self.drop_the_oldest();
        }
        let Some(front) = self.queue.front() else {
            return Ok(Action::Wait);
        };
        let item = chain.number(front.item());
        Ok(match () {
            // The end of the stream occupies a slot in every history like any item, so it waits for
            // credit too.
            () if !self.window.admits(item.seq, newest_pose) => Action::Wait,
            () if item.is(flag::END) => Action::End(item),
            () => Action::Process(item, front.received_ns),
        })
    }

    fn advance(&mut self) {
        let done = self.queue.pop_front();
        if let (Some(chain), Some(done)) = (&mut self.chain, &done) {
            let (scan, published) = (done.item().scan, done.item().published);
            let stamp_ns = done.item().stamp_ns;
            let next = chain.next.saturating_add(1);
            self.in_order = self.in_order.saturating_sub(1);
            *chain = Chain {
                next,
                previous_scan: Some(scan),
                previous_ns: Some(stamp_ns),
                published: Some(published),
                repeats: false,
                ..*chain
            };
        }
        self.keep(done);
    }

    fn current(&self) -> Option<&Received<Scan>> {
        self.queue.front()
    }

    fn listener(&self) -> &Listener {
        self.port.listener()
    }

    /// The source may have lost it when all stages were restarted; the current scan is then masked
    /// as at the start of a chain.
    fn previous(&self) -> Option<&Received<Scan>> {
        let item = self.chain?.number(self.queue.front()?.item());
        let expected = (!item.is(flag::BREAK)).then_some(item.previous_scan);
        self.previous
            .as_ref()
            .filter(|previous| Some(previous.item().scan) == expected)
    }

    fn take_dropped(&mut self) -> Vec<Sample> {
        mem::take(&mut self.dropped)
    }
}

impl Chain {
    fn precedes(item: &Item, newest_pose: &Item) -> bool {
        !newest_pose.is(flag::BASE) && !item.is(flag::END) && item.published < newest_pose.published
    }

    /// Resumes with the scan of the newest pose if the source still has it, else with a break.
    fn resume(front: &Item, newest_pose: &Item) -> Self {
        let begin = |next, previous_scan: Option<u64>| Self {
            next,
            generation: Generation::default(),
            previous_scan,
            previous_ns: None,
            published: None,
            repeats: previous_scan.is_some(),
        };
        match () {
            () if newest_pose.is(flag::BASE) => begin(0, None),
            () if front.published == newest_pose.published && !front.is(flag::END) => {
                begin(newest_pose.seq, Some(newest_pose.previous_scan))
            }
            () => begin(newest_pose.seq.saturating_add(1), None),
        }
    }

    fn has_passed(&self, item: &Item) -> bool {
        !item.is(flag::END)
            && self
                .published
                .is_some_and(|published| item.published <= published)
    }

    fn number(&self, item: &Item) -> Item {
        let is_continuous = |before_ns| continues(before_ns, item.stamp_ns);
        let previous_scan = self
            .previous_scan
            .filter(|_| self.previous_ns.is_none_or(is_continuous) || item.is(flag::END));
        let start = match previous_scan {
            Some(_) => 0,
            None => flag::BREAK,
        };
        let mut item = Item {
            seq: self.next,
            previous_scan: previous_scan.unwrap_or(item.scan),
            flags: (item.flags & flag::END) | start,
            ..*item
        };
        self.generation.mark(&mut item);
        item
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn newest_pose() -> Item {
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
    fn a_resumed_chain_repeats_the_scan_of_the_newest_pose_or_starts_again_with_the_next_number() {
        let numbered = |published| {
            let scan = scan(published);
            Chain::resume(&scan, &newest_pose()).number(&scan)
        };
        let item = numbered(31);
        let numbers = [item.seq, item.scan, item.previous_scan, item.flags.into()];
        assert_eq!(numbers, [9, 40, 37, 0]);
        let item = numbered(35);
        assert_eq!((item.seq, item.previous_scan), (10, item.scan));
        assert!(item.is(flag::BREAK));
    }

    #[test]
    fn a_chain_breaks_where_time_does() {
        let second_ns = 1_000_000_000;
        let chain = Chain {
            previous_ns: Some(100 * second_ns),
            ..Chain::resume(&scan(31), &newest_pose())
        };
        for (stamp_s, breaks) in [(101, false), (110, false), (111, true), (99, true)] {
            let item = Item {
                stamp_ns: stamp_s * second_ns,
                ..scan(31)
            };
            assert_eq!(chain.number(&item).is(flag::BREAK), breaks, "{stamp_s}");
        }
    }

    #[test]
    fn scans_before_the_newest_pose_never_start_a_chain() {
        for (item, newest, precedes) in [
            (scan(30), newest_pose(), true),
            (scan(31), newest_pose(), false),
            (scan(0), newest_pose().flagged(flag::BASE), false),
            (scan(0).flagged(flag::END), newest_pose(), false),
        ] {
            assert_eq!(Chain::precedes(&item, &newest), precedes, "{item:?}");
        }
    }
}
