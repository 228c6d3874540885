//! Masks that a network makes: of each scan alone, or of each scan and the one before, for this pair.

use gyre_geometry::Twist;
use gyre_messages::MaskedHeader;
use gyre_radar::RasterConfig;

use crate::{
    MaskError, MaskingConfig,
    network::{Network, NetworkError},
    rasters::{Rasters, Sweep},
};

/// A network, and where it looks at two scans, their rasters.
#[derive(Debug)]
pub(crate) struct Learned {
    network: Network,
    cells: usize,
    /// Side by side as the network takes them: the raster of a scan, and that of the one before. Empty where it takes one.
    pair: Vec<f32>,
    /// The scan whose raster the second one is.
    kept: Option<u64>,
}

impl Learned {
    pub fn load(masking: &MaskingConfig, raster: &RasterConfig) -> Result<Self, NetworkError> {
        let network = Network::load(masking, raster)?;
        let cells = raster.n * raster.n;
        let pair = if network.scans() == 2 {
            vec![0.0; 2 * cells]
        } else {
            Vec::new()
        };
        Ok(Self {
            network,
            cells,
            pair,
            kept: None,
        })
    }

    /// Scans that the network looks at, and rasters that come of them.
    pub fn scans(&self) -> usize {
        self.network.scans()
    }

    /// What the network made of the scan that [`Learned::mask`] had last, and of the one before: `n * n` factors from 0 to 1 each.
    pub fn masks(&self) -> &[f32] {
        self.network.masks()
    }

    /// The first of [`Learned::masks`].
    pub fn mask_of_scan(&self) -> &[f32] {
        &self.masks()[..self.cells]
    }

    /// Writes the masked raster to the start of `out`, and where the network looks at two scans that of the scan before behind it
    /// (see [`MaskedHeader::raster_values`]). Where the chain starts the scan is its own scan before.
    pub fn mask(
        &mut self,
        rasters: &mut Rasters,
        sweep: &Sweep<'_>,
        before: Option<&Sweep<'_>>,
        out: &mut [f32],
    ) -> Result<Option<Twist>, MaskError> {
        if self.scans() == 1 {
            let raster = &mut out[..self.cells];
            let twist = rasters.make(sweep, raster)?;
            let mask = self.network.run(raster)?;
            raster
                .iter_mut()
                .zip(mask)
                .for_each(|(power, mask)| *power *= mask);
            return Ok(twist);
        }
        let twist = self.fill_pair(rasters, sweep, before)?;
        let masks = self.network.run(&self.pair)?;
        let places = out.chunks_mut(MaskedHeader::raster_values(self.cells));
        let masked = self
            .pair
            .chunks_exact(self.cells)
            .zip(masks.chunks_exact(self.cells));
        for (place, (raster, mask)) in places.zip(masked) {
            place
                .iter_mut()
                .zip(raster.iter().zip(mask))
                .for_each(|(out, (power, mask))| *out = power * mask);
        }
        self.pair.copy_within(..self.cells, self.cells);
        self.kept = Some(sweep.number);
        Ok(twist)
    }

    fn fill_pair(
        &mut self,
        rasters: &mut Rasters,
        sweep: &Sweep<'_>,
        before: Option<&Sweep<'_>>,
    ) -> Result<Option<Twist>, MaskError> {
        let (later, earlier) = self.pair.split_at_mut(self.cells);
        let twist = rasters.make(sweep, later)?;
        match before {
            Some(before) if self.kept == Some(before.number) => {}
            // After a start nothing is kept.
            Some(before) => drop(rasters.make(before, earlier)?),
            None => earlier.copy_from_slice(later),
        }
        Ok(twist)
    }
}
