//! The motions for motion compensation, by sequence number.
//!
//! Masking receives a motion twice: from the search, and with its journalled pose. It uses the
//! first one, so both must be equal. Therefore only the searched motion is used, which refinement
//! passes on unchanged. After a restart the motions up to the newest pose come from the journal;
//! the search finds later ones again.

use std::collections::VecDeque;

use gyre_messages::{Item, Motion, Pose, SearchedMotion, flag};
use gyre_radar::LostAzimuths;
use gyre_stage::{Launch, Listener, StageError, reader::Port};

/// Number of motions kept: more than any window and lag need.
const KEPT: usize = 256;

/// The known motions, and the newest pose.
pub struct Motions {
    motions: Port<Motion>,
    poses: Port<Pose>,
    known: KnownMotions,
    /// Where azimuths of scans with poses were lost, by number; the oldest are dropped.
    lost: VecDeque<(u64, LostAzimuths)>,
    resume_at: Option<Item>,
    newest_pose: Option<u64>,
}

impl Motions {
    pub fn open(launch: &Launch) -> Result<Self, StageError> {
        Ok(Self {
            motions: Port::open(launch)?,
            poses: Port::open(launch)?,
            known: KnownMotions::default(),
            lost: VecDeque::new(),
            resume_at: None,
            newest_pose: None,
        })
    }

    /// Receives the new motions and poses.
    pub fn update(&mut self) -> Result<(), StageError> {
        while let Some(received) = self.motions.receive()? {
            self.known
                .receive(received.item(), received.header().motion.searched());
        }
        while let Some(received) = self.poses.receive()? {
            let item = *received.item();
            if item.is(flag::END) {
                continue;
            }
            if !item.is(flag::BASE) {
                self.known
                    .receive(&item, received.header().motion.searched());
                self.newest_pose = self.newest_pose.max(Some(item.seq));
                self.lost.push_back((item.seq, item.lost_azimuths()));
                if self.lost.len() > KEPT {
                    self.lost.pop_front();
                }
            }
            if item.is(flag::SYNC) {
                self.resume_at = Some(item);
            }
        }
        Ok(())
    }

    /// Notes that a chain of motions starts with this scan, before its motion is received.
    pub fn start_chain(&mut self, seq: u64) {
        self.known.insert(seq, None);
    }

    /// Returns the motion of the item `lag` items before item `seq`: `None` while it is unknown,
    /// `Some(None)` if the chain starts there or later.
    pub fn before(&self, seq: u64, lag: u64) -> Option<Option<SearchedMotion>> {
        self.known.before(seq, lag)
    }

    /// Returns where azimuths of an item were lost, if it has a pose.
    pub fn lost(&self, seq: u64) -> Option<LostAzimuths> {
        let known = self.lost.iter().rev().find(|(known, _)| *known == seq);
        known.map(|(_, lost)| *lost)
    }

    /// Returns the item of the newest pose as the sink reported it; `None` before the first report.
    pub fn resume_at(&self) -> Option<&Item> {
        self.resume_at.as_ref()
    }

    /// Returns the number of the newest pose; `None` before the first.
    pub fn newest_pose(&self) -> Option<u64> {
        self.newest_pose
    }

    pub fn listeners(&self) -> [&Listener; 2] {
        [self.motions.listener(), self.poses.listener()]
    }
}

/// Motions in order of their numbers; the oldest are dropped.
#[derive(Default)]
struct KnownMotions(VecDeque<(u64, Option<SearchedMotion>)>);

impl KnownMotions {
    fn receive(&mut self, item: &Item, motion: SearchedMotion) {
        if !item.is(flag::END) {
            // Where the chain starts there is no motion.
            self.insert(item.seq, (!item.is(flag::BREAK)).then_some(motion));
        }
    }

    fn insert(&mut self, seq: u64, motion: Option<SearchedMotion>) {
        if self.of(seq).is_some() {
            return;
        }
        let place = self.0.partition_point(|(known, _)| *known < seq);
        self.0.insert(place, (seq, motion));
        if self.0.len() > KEPT {
            self.0.pop_front();
        }
    }

    /// See [`Motions::before`].
    fn before(&self, seq: u64, lag: u64) -> Option<Option<SearchedMotion>> {
        let Some(first) = seq.checked_sub(lag) else {
            return Some(None);
        };
        match (first + 1..=seq).any(|seq| self.of(seq) == Some(None)) {
            true => Some(None),
            false => self.of(first),
        }
    }

    fn of(&self, seq: u64) -> Option<Option<SearchedMotion>> {
        let known = self.0.iter().rev().find(|(known, _)| *known == seq);
        known.map(|(_, motion)| *motion)
    }
}

#[cfg(test)]
mod tests {
    use gyre_messages::MotionEstimate;

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
        Item {
            seq,
            flags,
            ..Item::default()
        }
    }

    #[test]
    fn a_motion_is_the_searched_one_whether_it_is_received_from_the_search_or_with_its_pose() {
        let searched = refined_to(1.5).searched();
        for order in [[1.5, 1.75], [1.75, 1.5]] {
            let mut known = KnownMotions::default();
            for x_m in order {
                known.receive(&item(7, 0), refined_to(x_m).searched());
            }
            assert_eq!(known.of(7), Some(Some(searched)));
            assert_eq!(known.of(8), None);
        }
    }

    #[test]
    fn where_the_chain_starts_there_is_no_motion_and_the_oldest_are_dropped() {
        let mut known = KnownMotions::default();
        for seq in 0..KEPT as u64 + 3 {
            let flags = if seq == 5 { flag::BREAK } else { 0 };
            known.receive(&item(seq, flags), refined_to(1.5).searched());
        }
        assert_eq!((known.of(2), known.of(5)), (None, Some(None)));
        assert_eq!(known.0.len(), KEPT);
    }

    #[test]
    fn no_motion_of_an_earlier_chain_is_used() {
        let mut known = KnownMotions::default();
        (0..10).for_each(|seq| known.receive(&item(seq, 0), refined_to(1.5).searched()));
        let searched = Some(refined_to(1.5).searched());
        assert_eq!(
            (known.before(9, 2), known.before(10, 2)),
            (Some(searched), Some(searched))
        );
        known.insert(10, None);
        assert_eq!(
            (known.before(10, 2), known.before(11, 2)),
            (Some(None), Some(None))
        );
        assert_eq!(
            (known.before(12, 2), known.before(13, 2)),
            (Some(None), None)
        );
        assert_eq!(known.before(1, 2), Some(None), "before the first");
    }
}
