//! Counts of the deliveries and losses of a sensor, in a file of the run's root: a source that
//! replaces a dead one continues to count, and observers see the counts while the run works.

use gyre_contract::control::{RECEIVED, Received};

use crate::{
    Manifest, RunError,
    numbers::{self, Numbers},
};

/// The name of the file: the numbers of [`Received`] in their order.
const FILE: &str = "source.received";

/// Returns the deliveries of a run's sensor; `None` if its source is no sensor.
pub fn read(manifest: &Manifest) -> Option<Received> {
    numbers::read(&manifest.root.join(FILE)).map(Received::of_numbers)
}

pub fn open(manifest: &Manifest) -> Result<Numbers<RECEIVED>, RunError> {
    Numbers::open(manifest, FILE)
}
