use gyre_geometry::Twist;
use gyre_radar::raster::RasterConfig;
use ndarray::{Array3, ArrayView2, ArrayViewMut2, Axis, Zip, s};

use crate::{
    MaskError, MaskingConfig, Sweep,
    compensation::CompensatedRaster,
    network::{Network, NetworkError},
};

#[derive(Debug)]
pub(crate) struct LearnedMask {
    network: Network,
    /// The rasters of a scan and of the previous one, 2 x n x n, for a network that takes two.
    pair: Option<Array3<f32>>,
    /// The scan whose raster is the second of the pair.
    previous: Option<u64>,
}

impl LearnedMask {
    pub fn load(masking: &MaskingConfig, raster: &RasterConfig) -> Result<Self, NetworkError> {
        let network = Network::load(masking, raster)?;
        let pair = (network.scans() == 2).then(|| Array3::zeros((2, raster.n, raster.n)));
        Ok(Self {
            network,
            pair,
            previous: None,
        })
    }

    pub fn scans(&self) -> usize {
        self.network.scans()
    }

    pub fn can_follow(&self, number: u64) -> bool {
        self.pair.is_none() || self.previous == Some(number)
    }

    pub fn factors(&self, scan: usize) -> Option<ArrayView2<'_, f32>> {
        let masks = self.network.masks();
        (scan < masks.len_of(Axis(0))).then(|| masks.index_axis_move(Axis(0), scan))
    }

    pub fn set_previous(
        &mut self,
        rasters: &mut CompensatedRaster,
        sweep: &Sweep<'_>,
    ) -> Result<(), MaskError> {
        if let Some(pair) = &mut self.pair {
            rasters.make(sweep, pair.index_axis_mut(Axis(0), 1))?;
            self.previous = Some(sweep.number);
        }
        Ok(())
    }

    pub fn mask(
        &mut self,
        rasters: &mut CompensatedRaster,
        sweep: &Sweep<'_>,
        follows: Option<u64>,
        mut later: ArrayViewMut2<'_, f32>,
        earlier: Option<ArrayViewMut2<'_, f32>>,
    ) -> Result<Option<Twist>, MaskError> {
        let Some(pair) = &mut self.pair else {
            let twist = rasters.make(sweep, later.view_mut())?;
            let masks = self.network.run(later.view().insert_axis(Axis(0)))?;
            later *= &masks.index_axis_move(Axis(0), 0);
            return Ok(twist);
        };
        let Some(earlier) = earlier.filter(|_| follows.is_none() || self.previous == follows)
        else {
            return Err(MaskError::MissingPrevious(follows.unwrap_or(sweep.number)));
        };
        let twist = rasters.make(sweep, pair.index_axis_mut(Axis(0), 0))?;
        if follows.is_none() {
            copy_first_to_second(pair);
        }
        let masks = self.network.run(pair.view())?;
        for (scan, out) in [later, earlier].into_iter().enumerate() {
            let (raster, mask) = (
                pair.index_axis(Axis(0), scan),
                masks.index_axis(Axis(0), scan),
            );
            Zip::from(out)
                .and(raster)
                .and(mask)
                .for_each(|out, power, mask| *out = power * mask);
        }
        copy_first_to_second(pair);
        self.previous = Some(sweep.number);
        Ok(twist)
    }
}

fn copy_first_to_second(pair: &mut Array3<f32>) {
    let (first, mut second) = pair.multi_slice_mut((s![0, .., ..], s![1, .., ..]));
    second.assign(&first);
}
