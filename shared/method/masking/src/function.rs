//! Masks of your own: a function from a scan to factors.

use std::{error::Error, fmt};

use gyre_geometry::{PolarScan, Twist};
use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use crate::{MaskError, Sweep, compensation::CompensatedRaster};

/// A mask of your own: `gyre new` begins a stage with one (`services/tools/templates/rust`).
pub trait MaskFunction: fmt::Debug + Send + Sync {
    /// Returns factors from 0 to 1 for a scan. `raster` shows it with motion compensation, above
    /// the threshold: n x n, row 0 far ahead, column 0 far left. The same scan must give the same
    /// factors, after a restart too.
    fn factors(
        &mut self,
        scan: &PolarScan<'_>,
        raster: ArrayView2<'_, f32>,
    ) -> Result<Factors, Box<dyn Error + Send + Sync>>;
}

#[derive(Debug)]
pub enum Factors {
    /// Of the powers, azimuth x range bin: raster and points are made from the masked powers.
    OfPower(Array2<f32>),
    /// Of the cells of the raster, n x n. The weights of points are multiplied as with a network's
    /// mask.
    OfRaster(Array2<f32>),
}

#[derive(Debug)]
pub(crate) struct AppliedFunction {
    function: Box<dyn MaskFunction>,
    raster: Option<Array2<f32>>,
    /// The powers of the last scan that are left, row after row, if it gave factors of powers.
    powers: Vec<u8>,
}

impl AppliedFunction {
    pub fn new(function: Box<dyn MaskFunction>) -> Self {
        Self {
            function,
            raster: None,
            powers: Vec::new(),
        }
    }

    pub fn mask(
        &mut self,
        rasters: &mut CompensatedRaster,
        sweep: &Sweep<'_>,
        mut later: ArrayViewMut2<'_, f32>,
    ) -> Result<Option<Twist>, MaskError> {
        let scan = &sweep.scan;
        scan.check()?;
        let twist = rasters.make(sweep, later.view_mut())?;
        let factors = self.function.factors(scan, later.view());
        self.powers.clear();
        self.raster = match factors.map_err(|error| MaskError::Function(error.to_string()))? {
            Factors::OfRaster(factors) => {
                check(&factors, later.dim())?;
                later *= &factors;
                Some(factors)
            }
            Factors::OfPower(factors) => {
                let power = scan.power();
                check(&factors, power.dim())?;
                for (power, factors) in power.rows().into_iter().zip(factors.rows()) {
                    let left = power.iter().zip(factors);
                    let left = left.map(|(power, factor)| f32::from(*power) * factor);
                    self.powers.extend(left.map(|power| power.round() as u8));
                }
                let scan = self.left(scan);
                rasters.make(&Sweep { scan, ..*sweep }, later)?;
                None
            }
        };
        Ok(twist)
    }

    pub fn left<'a>(&'a self, scan: &PolarScan<'a>) -> PolarScan<'a> {
        if self.powers.is_empty() {
            return *scan;
        }
        let mut left = *scan;
        left.bytes = &self.powers;
        left.geometry.stride = scan.geometry.bins;
        left.geometry.first_byte = 0;
        left
    }

    pub fn factors(&self) -> Option<ArrayView2<'_, f32>> {
        self.raster.as_ref().map(|factors| factors.view())
    }
}

fn check(factors: &Array2<f32>, expected: (usize, usize)) -> Result<(), MaskError> {
    let failed = |reason: String| Err(MaskError::Function(reason));
    if factors.dim() != expected {
        return failed(format!(
            "the mask is {:?}: expected {expected:?}",
            factors.dim()
        ));
    }
    match factors.iter().find(|factor| !(0.0..=1.0).contains(*factor)) {
        Some(factor) => failed(format!(
            "the mask has a factor of {factor}: expected 0 to 1"
        )),
        None => Ok(()),
    }
}
