//! The poses of a run for its track, in order and each once: those that were there before the
//! observer are read from the journal, a part at a time, while the newest ones are shown.

use std::path::{Path, PathBuf};

use gyre_journal::{self as journal, Records};
use gyre_messages::{PoseHeader, flag};

/// Poses that are read between two looks at the newest ones: about a megabyte.
const SLICE: usize = 2000;

pub(crate) struct JournalTrack {
    journal: PathBuf,
    next: u64,
    newest: u64,
    /// The journal from the next pose on, as long as the track is behind the newest one.
    records: Option<Records>,
}

impl JournalTrack {
    pub fn of(out: &Path) -> Self {
        Self {
            journal: journal::path(out),
            next: 0,
            newest: 0,
            records: None,
        }
    }

    /// Sees a pose that was published. It is added at once if those before it are in the track, or
    /// if no journal has them.
    pub fn see(&mut self, pose: &PoseHeader, add: impl FnOnce(&PoseHeader)) {
        let seq = pose.item.seq;
        if seq < self.next {
            return;
        }
        self.newest = self.newest.max(seq);
        if seq > self.next && self.records.is_none() {
            let records = journal::records_from(&self.journal, self.next);
            self.records = records.ok().flatten();
        }
        if self.records.is_none() {
            add(pose);
            self.next = seq + 1;
        }
    }

    /// Adds some of the poses that the track lacks; returns whether it may lack more.
    pub fn catch_up(&mut self, mut add: impl FnMut(&PoseHeader)) -> bool {
        let Some(records) = &mut self.records else {
            return false;
        };
        let before = self.next;
        while self.next <= self.newest && self.next - before < SLICE as u64 {
            match records.next() {
                Some(Ok(pose)) if !pose.item.is(flag::END) => add(&pose),
                // Poses that the journal lacks are not drawn.
                _ => self.next = self.newest,
            }
            self.next += 1;
        }
        if self.next > self.newest {
            self.records = None;
        }
        self.records.is_some()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use gyre_journal::Journal;
    use gyre_messages::Item;

    use super::*;

    fn pose(seq: u64) -> PoseHeader {
        PoseHeader {
            item: Item {
                seq,
                ..Item::default()
            },
            ..PoseHeader::default()
        }
    }

    #[test]
    fn a_long_journal_is_read_in_parts_once_and_the_newest_poses_follow_it() {
        let out = tempfile::tempdir().unwrap();
        let path = journal::path(out.path());
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut journal = Journal::open(&path).unwrap();
        let poses = 2 * SLICE as u64 + 7;
        (0..poses).for_each(|seq| journal.append(&pose(seq)).unwrap());
        let mut track = JournalTrack::of(out.path());
        let mut drawn = Vec::new();
        track.see(&pose(poses - 2), |_| {
            panic!("those before it are not drawn")
        });
        assert!(track.catch_up(|pose| drawn.push(pose.item.seq)));
        assert_eq!(drawn.len(), SLICE);
        // The observer failed, and attached again: it is sent the last poses again.
        track.see(&pose(poses - 3), |_| panic!("twice"));
        track.see(&pose(poses - 1), |_| panic!("too early"));
        while track.catch_up(|pose| drawn.push(pose.item.seq)) {}
        track.see(&pose(poses - 1), |_| panic!("twice"));
        track.see(&pose(poses), |pose| drawn.push(pose.item.seq));
        assert!(!track.catch_up(|_| panic!("nothing is missing")));
        assert_eq!(drawn, (0..=poses).collect::<Vec<u64>>());
    }

    #[test]
    fn without_a_journal_what_is_published_is_drawn() {
        let out = tempfile::tempdir().unwrap();
        let mut track = JournalTrack::of(out.path());
        let mut drawn = Vec::new();
        for seq in [5, 6, 9, 8] {
            track.see(&pose(seq), |pose| drawn.push(pose.item.seq));
            assert!(!track.catch_up(|_| panic!("there is none")));
        }
        assert_eq!(drawn, [5, 6, 9]);
    }
}
