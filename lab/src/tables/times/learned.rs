//! A learned mask on rasters that are ready.

use gyre_masking::{
    MaskKind,
    network::{Network, NetworkError},
};
use gyre_messages::Pair;

use gyre::configuration::Configuration;

/// A network with the rasters that it masks.
pub struct Learned {
    network: Network,
    /// As the network takes them: the raster of a scan, and where it looks at two that of the scan before.
    input: Vec<f32>,
    /// The masked rasters of a scan and of the one before.
    masked: [Vec<f32>; 2],
}

impl Learned {
    /// `None` where no network masks.
    ///
    /// # Errors
    /// A network that cannot be used.
    pub fn load(configuration: &Configuration) -> Result<Option<Self>, NetworkError> {
        if configuration.masking.kind != MaskKind::Learned {
            return Ok(None);
        }
        let network = Network::load(&configuration.masking, &configuration.raster)?;
        let raster = vec![0.0; configuration.raster.n * configuration.raster.n];
        Ok(Some(Self {
            input: raster.repeat(network.scans()),
            network,
            masked: [raster.clone(), raster],
        }))
    }

    /// Scans that the network looks at.
    pub fn scans(&self) -> usize {
        self.network.scans()
    }

    /// Lays rasters where the network reads them: masking makes them there.
    pub fn take(&mut self, rasters: [&[f32]; 2]) {
        for (place, raster) in self.input.chunks_exact_mut(rasters[0].len()).zip(rasters) {
            place.copy_from_slice(raster);
        }
    }

    /// Masks what was taken. A mask of one scan has the one before from the last time.
    ///
    /// # Errors
    /// What ONNX Runtime says.
    pub fn mask(&mut self) -> Result<Pair<'_>, NetworkError> {
        self.masked.swap(0, 1);
        let cells = self.masked[0].len();
        let masks = self.network.run(&self.input)?;
        let rasters = self
            .input
            .chunks_exact(cells)
            .zip(masks.chunks_exact(cells));
        for (masked, (raster, mask)) in self.masked.iter_mut().zip(rasters) {
            masked
                .iter_mut()
                .zip(raster.iter().zip(mask))
                .for_each(|(masked, (power, mask))| *masked = power * mask);
        }
        let [later, earlier] = &self.masked;
        Ok(Pair {
            later,
            earlier: Some(earlier),
        })
    }
}
