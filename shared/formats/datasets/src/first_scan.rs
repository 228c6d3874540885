//! The first scan of a recording, which shows the capabilities of its radar.

use gyre_geometry::OwnedScan;
use gyre_radar::{NoDoppler, check_chirps};

use crate::Dataset;

/// Checks by the first scan of a recording that its radar measures the velocity by Doppler: see
/// [`check_chirps`]. A scan that cannot be read is reported where it is played.
pub fn check_first_scan(dataset: &mut dyn Dataset) -> Result<(), NoDoppler> {
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let Ok(geometry) = dataset.read(dataset.first(), scan.slot()) else {
        return Ok(());
    };
    scan.geometry = geometry;
    check_chirps(&scan.view())
}
