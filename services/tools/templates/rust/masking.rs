//! A mask: which returns count, for the search and for the points.

use std::{error::Error, process::ExitCode};

use gyre_geometry::PolarScan;
use gyre_masking::{Factors, MaskFunction};
use ndarray::ArrayView2;

#[derive(Debug)]
struct MyMask;

impl MaskFunction for MyMask {
    /// Returns factors from 0 to 1: of the powers (azimuth x range bin), or of the cells of the
    /// raster (n x n, row 0 far ahead).
    fn factors(
        &mut self,
        scan: &PolarScan<'_>,
        _raster: ArrayView2<'_, f32>,
    ) -> Result<Factors, Box<dyn Error + Send + Sync>> {
        let factors = scan.power().mapv(|power| f32::from(power > 70));
        Ok(Factors::OfPower(factors))
    }
}

fn main() -> ExitCode {
    gyre_stage::launch::main("masking", |launch| {
        gyre_stages::masking::run_with(launch, Box::new(MyMask))
    })
}
