//! A mask that is a function of Python: `mask(scan)`.

use std::{error::Error, path::Path};

use gyre_geometry::{PolarScan, Sense};
use gyre_masking::{Factors, MaskFunction};
use gyre_radar::RasterConfig;
use gyre_stage::{
    Launch,
    python_function::{Argument, Array, Function, Returned, Scan},
};
use gyre_transport::RunError;
use ndarray::{ArrayView1, ArrayView2};
use serde_json::{Map, json};

/// Loads the function `mask` of a file of Python, for [`run_with`](crate::masking::run_with).
pub fn python(launch: &Launch, file: &Path) -> Result<Box<dyn MaskFunction>, RunError> {
    let raster: RasterConfig = launch.section("raster")?;
    let function = Function::load(file, "mask")?;
    let cell_m = raster.cell_m;
    Ok(Box::new(PythonMask { function, cell_m }))
}

#[derive(Debug)]
struct PythonMask {
    function: Function,
    cell_m: f32,
}

impl MaskFunction for PythonMask {
    fn factors(
        &mut self,
        scan: &PolarScan<'_>,
        raster: ArrayView2<'_, f32>,
    ) -> Result<Factors, Box<dyn Error + Send + Sync>> {
        let geometry = &scan.geometry;
        let values = [
            ("stamp_ns", json!(geometry.stamp_ns)),
            ("range_resolution_m", json!(geometry.range_resolution_m)),
            ("range_offset_m", json!(geometry.range_offset_m)),
            ("clockwise", json!(geometry.sense == Sense::Clockwise)),
            ("cell_m", json!(self.cell_m)),
        ];
        let azimuths = ArrayView1::from(&scan.azimuth_rad[..geometry.azimuths]);
        let scan = Scan {
            values: Map::from_iter(values.map(|(name, value)| (name.to_owned(), value))),
            arrays: vec![
                ("power", Array::Bytes(scan.power().into_dyn())),
                ("azimuth_rad", Array::Floats(azimuths.into_dyn())),
                ("raster", Array::Floats(raster.into_dyn())),
            ],
        };
        match self.function.call(&[Argument::Scan(scan)])? {
            Returned::Factors(factors, of) if of == "power" => Ok(Factors::OfPower(factors)),
            Returned::Factors(factors, _) => Ok(Factors::OfRaster(factors)),
            Returned::Values(_) => Err("the mask is no array".into()),
        }
    }
}
