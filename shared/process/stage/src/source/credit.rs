//! The progress of the run, which admits the scans of a source.

use gyre_messages::{Item, Pose, flag};

use crate::{Launch, StageError, reader::Port};

/// The progress of the run, from its poses.
pub(crate) struct Credit {
    pub poses: Port<Pose>,
    /// Sequence number of the newest pose.
    pub newest: Option<u64>,
    /// The same at the source.
    pub published: Option<u64>,
    /// The newest pose of the trajectory at the last start of the sink.
    pub resume_at: Option<Item>,
    /// True if the sink has journalled the end of the stream.
    pub has_ended: bool,
}

impl Credit {
    pub fn open(launch: &Launch) -> Result<Self, StageError> {
        Ok(Self {
            poses: Port::open(launch)?,
            newest: None,
            published: None,
            resume_at: None,
            has_ended: false,
        })
    }

    pub fn update(&mut self) -> Result<(), StageError> {
        while let Some(pose) = self.poses.receive()? {
            let item = pose.item();
            self.has_ended |= item.is(flag::END);
            if item.is(flag::SYNC) {
                self.resume_at = Some(*item);
            }
            if !item.is(flag::BASE) && !item.is(flag::END) {
                self.newest = self.newest.max(Some(item.seq));
                self.published = self.published.max(Some(item.published));
            }
        }
        Ok(())
    }
}
