//! The queue of masking: which scans are taken, and in what order.

use gyre_messages::{Item, Scan};
use gyre_samples::Sample;
use gyre_stage::{Listener, StageError, inputs::Action, reader::Received};

/// The queue in lossless or in live mode.
pub trait Queue {
    fn receive(&mut self) -> Result<(), StageError>;

    /// Returns what to do with the current scan. `resume_at` is the item of the newest pose at the
    /// last start of the sink, `newest_pose` the number of the newest pose now.
    fn next_action(
        &mut self,
        resume_at: &Item,
        newest_pose: Option<u64>,
    ) -> Result<Action, StageError>;

    /// Returns the current scan if one has been received.
    fn current(&self) -> Option<&Received<Scan>>;

    /// Returns the previous scan, if the mask takes two and the chain is unbroken.
    fn previous(&self) -> Option<&Received<Scan>>;

    fn advance(&mut self);

    /// Returns the listener that the source notifies.
    fn listener(&self) -> &Listener;

    /// Returns the number of scans that were skipped because they had been received before.
    fn duplicates(&self) -> u64 {
        0
    }

    /// Takes the samples of the scans that were dropped since the last call.
    fn take_dropped(&mut self) -> Vec<Sample> {
        Vec::new()
    }
}
