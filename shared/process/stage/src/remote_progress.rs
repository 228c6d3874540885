//! The progress of stages on another machine. While those owe something, nobody here does: the
//! supervisor reads it before it looks for a stall.

use crate::{
    Manifest, StageError,
    numbers::{self, Numbers},
};

/// The name of the file in the run's root: one more than `Item::published` of the newest item that
/// was handed over.
const FILE: &str = "elsewhere";

/// Begins without the other machine, which has not reported where it continues.
pub(crate) fn begin(manifest: &Manifest) -> Result<Numbers<1>, StageError> {
    let mut file = Numbers::open(manifest, FILE)?;
    file.write([u64::MAX])?;
    Ok(file)
}

/// Returns whether stages on another machine owe the pose of an item that was handed over to them,
/// after so many poses.
pub fn owes(manifest: &Manifest, poses: u64) -> bool {
    numbers::read(&manifest.root.join(FILE)).is_some_and(|[items]| items > poses)
}
