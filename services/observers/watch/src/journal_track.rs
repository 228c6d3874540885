//! The poses of a run for its track, in order and each once: the journal has those that were there
//! before the observer, and those that it has missed. They are read a part at a time, while the
//! newest ones are shown: the journal of a month has gigabytes.

use std::path::{Path, PathBuf};

use gyre_client::RecordReader;
use gyre_contract::PoseHeader;

/// Poses that are read at once: about a megabyte.
const PART: usize = 2000;

pub(crate) struct JournalTrack {
    out: PathBuf,
    next: u64,
}

impl JournalTrack {
    pub fn of(out: &Path) -> Self {
        Self {
            out: out.to_owned(),
            next: 0,
        }
    }

    /// Adds a pose that was published, after the poses of the journal between it and the track.
    /// True if these were too many at once: the same pose again adds more.
    pub fn see(&mut self, pose: &PoseHeader, mut add: impl FnMut(&PoseHeader)) -> bool {
        let seq = pose.item.seq;
        if seq < self.next {
            return false;
        }
        if seq > self.next {
            let journal = RecordReader::<PoseHeader>::open(&self.out);
            let journal = journal.map(|it| it.from(self.next as usize));
            let records = journal.into_iter().flatten();
            // Poses that the journal lacks are not drawn.
            let before = records.map_while(Result::ok);
            let before = before.take_while(|before| before.item.seq < seq);
            let read = before.take(PART).inspect(&mut add).count();
            if read == PART {
                self.next += PART as u64;
                return true;
            }
        }
        add(pose);
        self.next = seq + 1;
        false
    }
}

#[cfg(test)]
mod tests {
    use gyre_contract::Item;
    use gyre_storage::RecordLog;

    use super::*;

    fn pose(seq: u64) -> PoseHeader {
        PoseHeader {
            item: Item::numbered(seq),
            ..PoseHeader::default()
        }
    }

    #[test]
    fn the_poses_of_the_journal_are_drawn_once_and_the_newest_poses_follow_them() {
        let out = tempfile::tempdir().unwrap();
        let mut journal = RecordLog::open(out.path()).unwrap();
        let poses = 2 * PART as u64 + 10;
        (0..poses).for_each(|seq| journal.append(&pose(seq)).unwrap());
        let mut track = JournalTrack::of(out.path());
        let mut drawn = Vec::new();
        assert!(track.see(&pose(poses - 10), |pose| drawn.push(pose.item.seq)));
        assert_eq!(drawn.len(), PART);
        // The observer fails after the second, attaches again, and is sent the last poses again.
        for before in [10, 10, 11, 10, 5, 1, 1, 0] {
            while track.see(&pose(poses - before), |pose| drawn.push(pose.item.seq)) {}
        }
        assert_eq!(drawn, (0..=poses).collect::<Vec<u64>>());
    }

    #[test]
    fn without_a_journal_what_is_published_is_drawn() {
        let out = tempfile::tempdir().unwrap();
        let mut track = JournalTrack::of(out.path());
        let mut drawn = Vec::new();
        for seq in [5, 6, 9, 8] {
            assert!(!track.see(&pose(seq), |pose| drawn.push(pose.item.seq)));
        }
        assert_eq!(drawn, [5, 6, 9]);
    }
}
