//! The window, and from it every queue, history and segment: memory is bounded and known before the first scan.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{TOPICS, topic::History};

/// Processes that may open a topic at once; one that just died counts until it has been cleaned up.
pub const MAX_NODES: usize = 16;
/// Samples that a reader may hold: the scan before, the current one, one in passing.
const BORROWED: usize = 3;
/// Samples that a publisher fills at once.
const LOANED: usize = 1;

/// How many scans may be in flight, and how far back the stages look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Window {
    /// Most scans between admission and their pose (W).
    pub scans: usize,
    /// Motion compensation of scan k uses the motion of scan k - lag (L); 0 where there is none.
    pub lag: usize,
    /// Scans before k that the work on k needs, along the longest path (LB).
    pub look_back: usize,
    /// Scans that the source keeps for a live masking stage; 0 in lossless mode.
    pub live_depth: usize,
}

/// A window that cannot work.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum WindowError {
    /// Too small or too large.
    #[error("run.window is {0}, but it must be at least 1 and at most 64 scans")]
    Scans(usize),
    /// Motions that old are not kept.
    #[error("masking.lag is {0}, but it must be at most 16 scans")]
    Lag(usize),
}

/// Sizes of one topic's queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicSizes {
    /// Samples that a publisher keeps for readers that come later.
    pub history: usize,
    /// Samples that wait in a reader's queue.
    pub buffer: usize,
    /// Samples that a reader may hold.
    pub borrowed: usize,
    /// Samples that the publisher may fill at once.
    pub loaned: usize,
    /// Readers.
    pub readers: usize,
}

impl TopicSizes {
    /// Samples in the publisher's segment.
    pub fn samples(&self) -> usize {
        self.readers * (self.buffer + self.borrowed) + self.history + self.loaned
    }
}

impl Window {
    /// Checks the bounds of its numbers.
    ///
    /// # Errors
    /// The first number that is out of its bounds.
    pub fn validate(&self) -> Result<(), WindowError> {
        if !(1..=64).contains(&self.scans) {
            return Err(WindowError::Scans(self.scans));
        }
        if self.lag > 16 {
            return Err(WindowError::Lag(self.lag));
        }
        Ok(())
    }

    /// Whether item `seq` may be in flight when `newest_pose` is the last one finished.
    pub fn admits(&self, seq: u64, newest_pose: Option<u64>) -> bool {
        let scans = self.scans as u64;
        newest_pose.map_or(seq < scans, |newest| seq <= newest.saturating_add(scans))
    }

    /// Sizes of a topic's queues. A restarted reader first gets the history, and what was already past it can still
    /// finish and let `scans` new ones in: so a queue is longer than the history by the window.
    pub(crate) fn queues(&self, history: History, readers: usize) -> TopicSizes {
        let stream = self.scans + self.look_back;
        let history = match history {
            History::Stream => stream,
            History::Feedback => stream + self.scans + self.lag + 1,
        };
        TopicSizes {
            history,
            buffer: history + self.scans,
            borrowed: BORROWED,
            loaned: LOANED,
            readers,
        }
    }
}

/// The largest message of each kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Bytes of a scan's image.
    pub scan_bytes: usize,
    /// Cells of one raster.
    pub raster_cells: usize,
    /// Rasters in a `masked` message: 1 or 2.
    pub rasters: usize,
    /// Points in a `masked` message.
    pub points: usize,
}

/// How much shared memory a run needs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Footprint {
    /// Bytes of each topic's segment when all of it is in use, by topic.
    pub segments: Vec<(&'static str, usize)>,
}

impl Footprint {
    /// The footprint of a window and its largest messages.
    pub fn new(window: &Window, limits: &Limits) -> Self {
        let segments = TOPICS.map(|topic| {
            let samples = (topic.sizes)(window).samples();
            (topic.name, samples * (topic.max_sample_bytes)(limits))
        });
        Self {
            segments: segments.to_vec(),
        }
    }

    /// Bytes of all segments.
    pub fn total(&self) -> usize {
        self.segments.iter().map(|(_, bytes)| bytes).sum()
    }
}

impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let total_mb = self.total() as f64 / 1e6;
        write!(f, "{total_mb:.1} MB of shared memory at most (")?;
        for (i, (topic, bytes)) in self.segments.iter().enumerate() {
            let separator = if i == 0 { "" } else { ", " };
            write!(f, "{separator}{topic} {:.1}", *bytes as f64 / 1e6)?;
        }
        write!(f, ")")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Masked, Message, Pose, Scan};

    const WINDOW: Window = Window {
        scans: 4,
        lag: 2,
        look_back: 1,
        live_depth: 0,
    };

    #[test]
    fn queues_hold_the_history_and_a_window_more() {
        let scan = Scan::sizes(&WINDOW);
        assert_eq!((scan.history, scan.buffer, scan.samples()), (5, 9, 18));
        assert_eq!(Masked::sizes(&WINDOW).samples(), 42);
        let pose = Pose::sizes(&WINDOW);
        assert_eq!((pose.history, pose.buffer), (12, 16));
    }

    #[test]
    fn the_footprint_of_oxford_at_255_is_what_was_measured_with_such_sizes() {
        let limits = Limits {
            scan_bytes: 400 * 3779,
            raster_cells: 255 * 255,
            rasters: 2,
            points: 0,
        };
        let total = Footprint::new(&WINDOW, &limits).total();
        // 42.9 MB with two readers of `masked`; the third has twelve rasters of 0.52 MB more.
        assert!((48_000_000..52_000_000).contains(&total), "{total}");
    }

    #[test]
    fn a_pose_is_the_credit_for_one_more_scan() {
        assert!(WINDOW.admits(3, None) && !WINDOW.admits(4, None));
        assert!(WINDOW.admits(4, Some(0)) && !WINDOW.admits(5, Some(0)));
        assert!(WINDOW.admits(u64::MAX, Some(u64::MAX)));
    }

    #[test]
    fn an_empty_window_is_refused() {
        let empty = Window { scans: 0, ..WINDOW };
        assert_eq!(empty.validate(), Err(WindowError::Scans(0)));
        assert!(WINDOW.validate().is_ok());
    }
}
