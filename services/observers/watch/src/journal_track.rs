//! The poses of a run for its track, in order and each once: the journal has those that were there
//! before the observer, and those that it has missed.

use std::path::{Path, PathBuf};

use gyre_journal as journal;
use gyre_messages::PoseHeader;

pub(crate) struct JournalTrack {
    journal: PathBuf,
    next: u64,
}

impl JournalTrack {
    pub fn of(out: &Path) -> Self {
        Self {
            journal: journal::path(out),
            next: 0,
        }
    }

    /// Adds a pose that was published, after the poses of the journal between it and the track.
    pub fn see(&mut self, pose: &PoseHeader, mut add: impl FnMut(&PoseHeader)) {
        let seq = pose.item.seq;
        if seq < self.next {
            return;
        }
        if seq > self.next {
            let records = journal::records_from(&self.journal, self.next);
            let records = records.ok().flatten().into_iter().flatten();
            // Poses that the journal lacks are not drawn.
            let before = records.map_while(Result::ok);
            let before = before.take_while(|before| before.item.seq < seq);
            before.for_each(|before| add(&before));
        }
        add(pose);
        self.next = seq + 1;
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
    fn the_poses_of_the_journal_are_drawn_once_and_the_newest_poses_follow_them() {
        let out = tempfile::tempdir().unwrap();
        let path = journal::path(out.path());
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut journal = Journal::open(&path).unwrap();
        (0..2000).for_each(|seq| journal.append(&pose(seq)).unwrap());
        let mut track = JournalTrack::of(out.path());
        let mut drawn = Vec::new();
        // The observer fails after the first, attaches again, and is sent the last poses again.
        for seq in [1990, 1989, 1990, 1995, 1999, 1999, 2000] {
            track.see(&pose(seq), |pose| drawn.push(pose.item.seq));
        }
        assert_eq!(drawn, (0..=2000).collect::<Vec<u64>>());
    }

    #[test]
    fn without_a_journal_what_is_published_is_drawn() {
        let out = tempfile::tempdir().unwrap();
        let mut track = JournalTrack::of(out.path());
        let mut drawn = Vec::new();
        for seq in [5, 6, 9, 8] {
            track.see(&pose(seq), |pose| drawn.push(pose.item.seq));
        }
        assert_eq!(drawn, [5, 6, 9]);
    }
}
