//! The window of scans in flight, and the queue sizes that follow from it: memory is bounded and
//! known before the first scan.

use serde::{Deserialize, Serialize};

/// Processes of the run that may have a topic open at once. A dead process counts until its
/// resources are removed.
const NODES: usize = 16;
const MAX_OBSERVERS: usize = 64;
/// Samples that a reader may hold: the previous one, the current one, and one that is being
/// received.
const BORROWED: usize = 3;
const LOANED: usize = 1;
/// Messages of a topic that only observers read which one that comes late still receives.
const LATEST: usize = 16;

/// The number of scans in flight, and the look-back of the stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Window {
    /// Maximum number of scans in flight, between admission and pose (W).
    pub scans: usize,
    /// Lag of motion compensation (L): scan k uses the motion of scan k - L. 0 without motion
    /// compensation.
    pub lag: usize,
    /// Number of previous scans that processing one scan needs, along the longest path (LB).
    pub look_back: usize,
    /// Length of the history that the source keeps for masking in live mode; 0 in lossless mode.
    pub live_depth: usize,
    pub observers: usize,
    /// True in a run with SLAM: pose-integration keeps keyframes, and the topics of loops and
    /// corrections exist.
    pub slam: bool,
    /// True in a run with SLAM that names the map of an earlier drive: the topic of fixes exists.
    pub localises: bool,
    /// True in a run that tracks objects: pose-integration logs each scan with its points, and the
    /// topic of objects exists.
    pub objects: bool,
}

/// The reach of a publisher's history for restarted readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum History {
    /// Along the stream: the window and the look-back.
    Stream,
    /// Feedback to earlier stages: one more window, and the lag of motion compensation.
    Feedback,
    /// The last messages, for topics that only observers read.
    Latest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicSizes {
    /// Samples that the publisher keeps for late subscribers.
    pub history: usize,
    /// Length of a reader's queue.
    pub buffer: usize,
    pub borrowed: usize,
    pub loaned: usize,
    /// Number of readers, which are stages of the run or its supervisor.
    pub readers: usize,
    /// Number of further subscribers. They may lose samples, and hold at most one at a time.
    pub observers: usize,
}

impl TopicSizes {
    /// Samples in the publisher's segment. History and queues hold the same newest samples, so only
    /// the longest of them counts; each sample that a reader or an observer holds may be an older
    /// one.
    pub fn samples(&self) -> usize {
        self.history.max(self.buffer) + self.readers * self.borrowed + self.observers + self.loaned
    }

    pub fn subscribers(&self) -> usize {
        self.readers + self.observers
    }

    pub fn nodes(&self) -> usize {
        NODES + self.observers
    }
}

impl Window {
    pub fn validate(&self) -> Result<(), String> {
        let (scans, lag, observers) = (self.scans, self.lag, self.observers);
        match () {
            () if !(1..=64).contains(&scans) => {
                Err(format!("run.window is {scans}, but must be 1 to 64 scans"))
            }
            () if lag > 16 => Err(format!(
                "masking.lag is {lag}, but must be at most 16 scans"
            )),
            () if observers > MAX_OBSERVERS => Err(format!(
                "run.observers is {observers}, but must be at most {MAX_OBSERVERS}"
            )),
            () => Ok(()),
        }
    }

    /// Returns whether item `seq` may be admitted when `newest_pose` is the newest pose.
    pub fn admits(&self, seq: u64, newest_pose: Option<u64>) -> bool {
        let scans = self.scans as u64;
        newest_pose.map_or(seq < scans, |newest| seq <= newest.saturating_add(scans))
    }

    /// Returns whether the mask takes two scans. Masking then looks back at one scan more than the
    /// stages after it.
    pub fn masks_pairs(&self) -> bool {
        self.look_back > 1
    }

    /// Returns whether the last stage reads masked scans too, and logs their points.
    pub fn logs_points(&self) -> bool {
        self.slam || self.objects
    }

    /// Returns the sizes of a topic's queues. A restarted reader first receives the history. Items
    /// that are already further down the stream can finish meanwhile and admit `scans` new ones, so
    /// a queue is longer than the history by the window.
    pub(crate) fn queues(&self, history: History, readers: usize) -> TopicSizes {
        let stream = self.scans + self.look_back;
        let (history, more) = match history {
            History::Stream => (stream, self.scans),
            History::Feedback => (stream + self.scans + self.lag + 1, self.scans),
            History::Latest => (LATEST, 0),
        };
        TopicSizes {
            history,
            buffer: history + more,
            borrowed: BORROWED,
            loaned: LOANED,
            readers,
            // The transport has no topic without a place for a subscriber.
            observers: self.observers.max(usize::from(readers == 0)),
        }
    }
}

/// Sizes of the largest messages, and of the rasters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    pub scan_bytes: usize,
    pub raster_cells: usize,
    pub cell_m: f32,
    /// Rasters in a `masked` message: 1 or 2.
    pub rasters: usize,
    pub points: usize,
    pub samples: usize,
}

impl Limits {
    pub fn side(&self) -> usize {
        self.raster_cells.isqrt()
    }

    pub fn extent_m(&self) -> f64 {
        self.side() as f64 * f64::from(self.cell_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_the_credit_for_one_more_scan() {
        let window = Window {
            scans: 4,
            ..Window::default()
        };
        assert!(window.admits(3, None) && !window.admits(4, None));
        assert!(window.admits(4, Some(0)) && !window.admits(5, Some(0)));
        assert!(window.admits(u64::MAX, Some(u64::MAX)));
        assert!(window.validate().is_ok() && Window::default().validate().is_err());
    }
}
