//! A learned mask: a network in ONNX Runtime or in rten.

mod onnx_runtime;
mod rten;

use gyre_radar::raster::RasterConfig;
use gyre_simd::simd;
use ndarray::{Array3, ArrayView3, ArrayViewMut3, Axis};
use thiserror::Error;

use crate::networks::{planes, runtime::RuntimeError};
use crate::{Backend, MaskingConfig, model::Model};

const INPUT: &str = "scans";
const OUTPUT: &str = "masks";

#[derive(Debug, Error)]
pub enum NetworkError {
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    #[error("{0}")]
    Model(String),
    #[error("the learned mask cannot be computed: {0}")]
    Run(String),
}

impl NetworkError {
    fn load(by: Backend, model: &Model, reason: &str) -> Self {
        let (by, path) = (by.name(), model.file.display());
        Self::Model(format!("{by} cannot load {path}: {reason}"))
    }

    fn opset(by: Backend, model: &Model, opset: i64, known: &str) -> Self {
        let (by, path) = (by.name(), model.file.display());
        Self::Model(format!(
            "{path} has operators of version {opset}, and this {by} knows them up to {known}: export it again with opset={known}, or use a newer ONNX Runtime"
        ))
    }
}

#[derive(Debug)]
pub struct Network {
    engine: planes::Engine,
    masks: Array3<f32>,
}

impl Network {
    pub fn load(config: &MaskingConfig, raster: &RasterConfig) -> Result<Self, NetworkError> {
        let model = Model::read(config, raster).map_err(NetworkError::Model)?;
        let (engine, inputs, outputs) = match config.onnx_runtime()? {
            Some(path) => onnx_runtime::load(&path, &model, config)?,
            None => rten::load(&model)?,
        };
        let shape = [1, model.card.model.inputs, raster.n, raster.n];
        check("takes", INPUT, &inputs, shape, &model)?;
        check("gives", OUTPUT, &outputs, shape, &model)?;
        let [_, scans, rows, columns] = shape;
        let masks = Array3::zeros((scans, rows, columns));
        let mut network = Self { engine, masks };
        if let planes::Engine::Rten(..) = network.engine {
            let empty = network.masks.clone();
            network.run(empty.view()).map_err(|error| match error {
                NetworkError::Run(reason) => rten::rejected(&model, &reason),
                other => other,
            })?;
            network.masks = empty;
        }
        Ok(network)
    }

    /// Returns the number of scans that it takes and of masks that it gives: 1, or 2 (this scan,
    /// then the previous one).
    pub fn scans(&self) -> usize {
        self.masks.len_of(Axis(0))
    }

    /// Computes the masks (scans x n x n) of rasters (scans x n x n). A mask is a factor from 0 to
    /// 1; the network's values are clamped to that range.
    pub fn run(
        &mut self,
        rasters: ArrayView3<'_, f32>,
    ) -> Result<ArrayView3<'_, f32>, NetworkError> {
        let (scans, rows, columns) = rasters.dim();
        let (cells, masks) = (rasters.as_standard_layout(), self.masks.view_mut());
        let cells = cells.as_slice().unwrap_or_default();
        let shape = [1, scans, rows, columns];
        let computed = self
            .engine
            .compute(shape, cells, |_, factors| fill(masks, &factors));
        computed.map_err(NetworkError::Run)??;
        Ok(self.masks.view())
    }

    pub fn masks(&self) -> ArrayView3<'_, f32> {
        self.masks.view()
    }
}

fn fill(mut masks: ArrayViewMut3<'_, f32>, computed: &[f32]) -> Result<(), NetworkError> {
    let cells = masks.len();
    let Some(masks) = masks.as_slice_mut().filter(|_| cells == computed.len()) else {
        return Err(NetworkError::Run(format!(
            "{} values instead of {cells}",
            computed.len(),
        )));
    };
    match clamp(computed, masks) {
        0 => Ok(()),
        count => Err(NetworkError::Run(format!(
            "{count} of {cells} factors are NaN, so the model or its execution provider is broken; \
             get the model again, or set masking.provider to `cpu`",
        ))),
    }
}

/// Writes values clamped to 0 to 1, and returns how many are NaN.
#[simd]
fn clamp(values: &[f32], clamped: &mut [f32]) -> u32 {
    let mut broken = 0;
    for (clamped, value) in clamped.iter_mut().zip(values) {
        *clamped = value.clamp(0.0, 1.0);
        broken += u32::from(value.is_nan());
    }
    broken
}

fn check(
    verb: &str,
    name: &str,
    tensors: &[String],
    shape: [usize; 4],
    model: &Model,
) -> Result<(), NetworkError> {
    let expected = format!("`{name}` Float32 {shape:?}");
    match tensors {
        [tensor] if *tensor == expected => Ok(()),
        _ => Err(NetworkError::Model(format!(
            "{} {verb} {}, but by its card it must have only {expected}: export it again",
            model.file.display(),
            tensors.join(" and ")
        ))),
    }
}
