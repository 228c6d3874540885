//! A recording, and what other sensors measured meanwhile.

use gyre_datasets::{Dataset, ReadError, ScanSamples};
use gyre_geometry::{ScanSlot, SweepGeometry, samples::Sample};

pub struct Opened {
    pub scans: Box<dyn Dataset>,
    /// Samples of a gyro and of wheels, by the sections `gyro` and `wheels` of a configuration.
    pub samples: ScanSamples,
}

impl Opened {
    /// Decodes a scan, and returns the samples that come with it.
    pub fn read(
        &mut self,
        index: usize,
        slot: ScanSlot<'_>,
    ) -> Result<(SweepGeometry, Vec<Sample>), ReadError> {
        let stamps = slot.stamp_ns;
        let stamp_ns = &mut *stamps;
        let geometry = self.scans.read(index, ScanSlot { stamp_ns, ..slot })?;
        let stamps = stamps[..geometry.azimuths].iter().copied();
        let first = stamps.clone().min().unwrap_or(geometry.stamp_ns);
        let last = stamps.max().unwrap_or(geometry.stamp_ns);
        let samples = self.samples.of(self.scans.as_ref(), [first, last]);
        Ok((geometry, samples.into_owned()))
    }
}
