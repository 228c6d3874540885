//! The poses of a run, which show its progress.

use std::time::Instant;

use gyre_contract::{Item, Pose, flag};
use gyre_stage::schedule;
use gyre_transport::{
    Manifest, RunError,
    reader::{Port, Received},
};

use crate::run::Run;

pub(crate) struct Poses {
    pub port: Port<Pose>,
    newest: Option<Item>,
    seen: Option<Instant>,
}

impl Poses {
    pub fn of(run: &Run<'_>) -> Result<Self, RunError> {
        Ok(Self {
            port: Port::open(&run.node, run.manifest())?,
            newest: None,
            seen: None,
        })
    }

    /// Returns the next new pose, or the end; `None` if nothing has come.
    pub fn next(&mut self) -> Result<Option<Received<Pose>>, RunError> {
        while let Some(received) = self.port.receive()? {
            let item = *received.item();
            if item.is(flag::END) {
                return Ok(Some(received));
            }
            if is_new(self.newest.as_ref(), &item) {
                (self.newest, self.seen) = (Some(item), Some(Instant::now()));
                return Ok(Some(received));
            }
        }
        Ok(None)
    }

    pub fn newest_seq(&self) -> Option<u64> {
        self.newest.map(|newest| newest.seq)
    }

    pub fn count(&self) -> u64 {
        self.newest_seq().map_or(0, |newest| newest + 1)
    }

    pub fn dropped(&self) -> u64 {
        self.newest.map_or(0, |newest| newest.dropped())
    }

    pub fn age_s(&self) -> Option<f64> {
        self.seen.map(|seen| seen.elapsed().as_secs_f64())
    }

    /// Returns whether a scan has been published whose pose is not there. Unknown counts as yes.
    pub fn are_owed(&self, manifest: &Manifest) -> bool {
        let poses = self.newest.map_or(0, |newest| newest.published + 1);
        schedule::read(manifest).is_none_or(|source| source.published > poses)
    }
}

/// Returns whether a pose is one that has not been seen. A restarted process sends its last ones
/// again.
fn is_new(newest: Option<&Item>, item: &Item) -> bool {
    !item.is(flag::BASE) && newest.is_none_or(|newest| item.seq > newest.seq)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_that_are_sent_again_are_not_new() {
        let item = |seq, flags| Item {
            seq,
            flags,
            ..Item::default()
        };
        assert!(is_new(None, &item(0, 0)));
        assert!(!is_new(None, &item(7, flag::BASE)));
        let newest = item(7, 0);
        assert!(!is_new(Some(&newest), &item(7, 0)) && !is_new(Some(&newest), &item(3, 0)));
        assert!(is_new(Some(&newest), &item(8, 0)));
    }
}
