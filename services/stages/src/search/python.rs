//! Searches that are functions of Python: `rotation(scan, previous)` and `translation(scan,
//! previous, rotation_rad)`.

use std::path::Path;

use gyre_contract::{Header, Masked};
use gyre_matching::{MotionMatch, RotationMatch};
use gyre_radar::RasterConfig;
use gyre_stage::{
    Launch,
    inputs::PairView,
    python_function::{Argument, Array, Function, Returned, Scan},
};
use gyre_transport::RunError;
use nalgebra::matrix;
use ndarray::ArrayView2;
use serde_json::{Map, json};

use crate::search::{rotation, translation};

/// Loads the function `rotation` of a file: the yaw of the later scan in the frame of the earlier
/// one, rad, and its standard deviation.
pub fn rotation(launch: &Launch, file: &Path) -> Result<rotation::Search, RunError> {
    let (mut function, cell_m) = load(launch, file, "rotation")?;
    Ok(Box::new(move |pair| {
        let Some(scans) = scans(pair, cell_m)? else {
            return Ok(None);
        };
        let [angle_rad, variance_rad2] = call(&mut function, &scans.map(Argument::Scan))?;
        Ok(Some(RotationMatch {
            angle_rad,
            variance_rad2,
            score: 1.0,
            runner_up: None,
        }))
    }))
}

/// Loads the function `translation` of a file: the place of the later scan in the frame of the
/// earlier one, m, and its standard deviation or covariance.
pub fn translation(launch: &Launch, file: &Path) -> Result<translation::Search, RunError> {
    let (mut function, cell_m) = load(launch, file, "translation")?;
    Ok(Box::new(move |pair, rotation| {
        let Some([scan, previous]) = scans(pair, cell_m)? else {
            return Ok(None);
        };
        let (scan, previous) = (Argument::Scan(scan), Argument::Scan(previous));
        let arguments = [scan, previous, Argument::Number(rotation.angle_rad)];
        let [x_m, y_m, xx, xy, yx, yy] = call(&mut function, &arguments)?;
        Ok(Some(MotionMatch {
            x_m,
            y_m,
            yaw_rad: rotation.angle_rad,
            covariance: matrix![
                xx, xy, 0.0;
                yx, yy, 0.0;
                0.0, 0.0, rotation.variance_rad2
            ],
            score: 1.0,
            runner_up: None,
        }))
    }))
}

fn load(launch: &Launch, file: &Path, name: &str) -> Result<(Function, f32), RunError> {
    let raster: RasterConfig = launch.section("raster")?;
    Ok((Function::load(file, name)?, raster.cell_m))
}

/// Returns the two scans of a pair, the later one first; `None` where the chain of motions starts.
fn scans<'a>(
    pair: &'a PairView<'a, Masked>,
    cell_m: f32,
) -> Result<Option<[Scan<'a>; 2]>, RunError> {
    let rasters = pair.rasters()?;
    let (Some(earlier), Some(previous)) = (rasters.earlier, pair.previous) else {
        return Ok(None);
    };
    let later_ns = pair.current.header().item().stamp_ns;
    let earlier_ns = previous.header().item().stamp_ns;
    let scan = |raster: ArrayView2<'a, f32>, stamp_ns: i64| Scan {
        values: Map::from_iter([
            ("stamp_ns".to_owned(), json!(stamp_ns)),
            ("cell_m".to_owned(), json!(cell_m)),
        ]),
        arrays: vec![("raster", Array::Floats(raster.into_dyn()))],
    };
    Ok(Some([
        scan(rasters.later, later_ns),
        scan(earlier, earlier_ns),
    ]))
}

fn call<const N: usize>(
    function: &mut Function,
    arguments: &[Argument<'_>],
) -> Result<[f64; N], RunError> {
    let returned = function
        .call(arguments)
        .map_err(|error| RunError::Transient(error.to_string()))?;
    let values = match returned {
        Returned::Values(values) => values,
        Returned::Factors(..) => Vec::new(),
    };
    let count = values.len();
    <[f64; N]>::try_from(values).map_err(|_| {
        RunError::Transient(format!("the search returned {count} numbers: expected {N}"))
    })
}
