//! The motions for motion compensation, by sequence number. Masking receives a motion twice: from
//! the search, and with its journalled pose. So only the searched motion is used, which refinement
//! passes on unchanged. After a restart the motions up to the newest pose come from the journal.

use std::collections::BTreeMap;

use gyre_contract::{Item, Motion, MotionEstimate, flag};
use gyre_geometry::{LostAzimuths, Twist};
use gyre_stage::{Launch, source::Credit};
use gyre_transport::{Listener, RunError, reader::Port};

/// Number of motions kept: more than any window and lag need.
const KEPT: usize = 256;

pub struct Motions {
    motions: Port<Motion>,
    pub credit: Credit,
    pub known: KnownMotions,
    lost: BTreeMap<u64, LostAzimuths>,
}

impl Motions {
    pub fn open(launch: &Launch) -> Result<Self, RunError> {
        Ok(Self {
            motions: launch.port()?,
            credit: Credit::open(launch)?,
            known: KnownMotions::default(),
            lost: BTreeMap::new(),
        })
    }

    pub fn update(&mut self) -> Result<(), RunError> {
        while let Some(received) = self.motions.receive()? {
            self.known
                .receive(received.item(), &received.header().motion);
        }
        while let Some(received) = self.credit.take()? {
            let item = received.item();
            if !item.is(flag::BASE) && !item.is(flag::END) {
                self.known.receive(item, &received.header().motion);
                self.lost.insert(item.seq, item.lost_azimuths());
                drop_the_oldest(&mut self.lost);
            }
        }
        Ok(())
    }

    pub fn lost(&self, seq: u64) -> Option<LostAzimuths> {
        self.lost.get(&seq).copied()
    }

    pub fn listeners(&self) -> [&Listener; 2] {
        [self.motions.listener(), self.credit.poses.listener()]
    }
}

fn drop_the_oldest<T>(known: &mut BTreeMap<u64, T>) {
    if known.len() > KEPT {
        known.pop_first();
    }
}

/// The velocities of motions by their numbers; `None` where the chain starts.
#[derive(Default)]
pub struct KnownMotions(BTreeMap<u64, Option<Twist>>);

impl KnownMotions {
    fn receive(&mut self, item: &Item, motion: &MotionEstimate) {
        if !item.is(flag::END) {
            let starts = item.is(flag::BREAK);
            self.insert(item.seq, (!starts).then(|| motion.searched_twist()));
        }
    }

    /// Notes a velocity, unless it is known; `None`: a chain of motions starts with this scan.
    pub fn insert(&mut self, seq: u64, twist: Option<Twist>) {
        self.0.entry(seq).or_insert(twist);
        drop_the_oldest(&mut self.0);
    }

    /// Returns the velocity of the item `lag` items before item `seq`: `None` while it is unknown,
    /// `Some(None)` if the chain starts there or later.
    pub fn before(&self, seq: u64, lag: u64) -> Option<Option<Twist>> {
        let Some(first) = seq.checked_sub(lag) else {
            return Some(None);
        };
        match (first + 1..=seq).any(|seq| self.starts(seq)) {
            true => Some(None),
            false => self.of(first),
        }
    }

    /// Returns whether a chain is known to start with this item.
    pub fn starts(&self, seq: u64) -> bool {
        self.of(seq) == Some(None)
    }

    fn of(&self, seq: u64) -> Option<Option<Twist>> {
        self.0.get(&seq).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion with 1.5 m forward as the result of the search, refined to `x_m`.
    fn refined_to(x_m: f64) -> MotionEstimate {
        MotionEstimate {
            x_m,
            searched: [1.5, -0.25, 0.125],
            interval_ns: 250_000_000,
            ..MotionEstimate::default()
        }
    }

    fn item(seq: u64, flags: u32) -> Item {
        Item::numbered(seq).flagged(flags)
    }

    #[test]
    fn a_motion_is_the_searched_one_whether_it_is_received_from_the_search_or_with_its_pose() {
        let searched = refined_to(1.5).searched_twist();
        for order in [[1.5, 1.75], [1.75, 1.5]] {
            let mut known = KnownMotions::default();
            for x_m in order {
                known.receive(&item(7, 0), &refined_to(x_m));
            }
            assert_eq!((known.of(7), known.of(8)), (Some(Some(searched)), None));
        }
    }

    #[test]
    fn where_the_chain_starts_there_is_no_motion_and_the_oldest_are_dropped() {
        let mut known = KnownMotions::default();
        for seq in 0..KEPT as u64 + 3 {
            let flags = if seq == 5 { flag::BREAK } else { 0 };
            known.receive(&item(seq, flags), &refined_to(1.5));
        }
        assert_eq!((known.of(2), known.of(5)), (None, Some(None)));
        assert_eq!(known.0.len(), KEPT);
    }

    #[test]
    fn no_motion_of_an_earlier_chain_is_used() {
        let mut known = KnownMotions::default();
        (0..10).for_each(|seq| known.receive(&item(seq, 0), &refined_to(1.5)));
        let searched = Some(Some(refined_to(1.5).searched_twist()));
        assert_eq!([9, 10].map(|seq| known.before(seq, 2)), [searched; 2]);
        known.insert(10, None);
        let expected = [Some(None), Some(None), Some(None), None];
        assert_eq!([10, 11, 12, 13].map(|seq| known.before(seq, 2)), expected);
        assert_eq!(known.before(1, 2), Some(None), "before the first");
    }
}
