//! A learned mask: the network in ONNX Runtime.

use std::path::PathBuf;

use gyre_radar::raster::RasterConfig;
use ndarray::{Array3, ArrayView3, Axis};
use ort::{
    environment::Environment,
    ep::ExecutionProviderDispatch,
    session::{Session, builder::SessionBuilder},
    value::{Outlet, TensorElementType, TensorRef, ValueType},
};
use thiserror::Error;

use crate::{
    MaskingConfig, Provider,
    model::{Model, ModelError},
    runtime::{self, RuntimeError},
};

const INPUT: &str = "scans";
const OUTPUT: &str = "masks";

/// Why there is no mask.
#[derive(Debug, Error)]
pub enum NetworkError {
    /// The model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// ONNX Runtime.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// This build cannot do it.
    #[error(
        "masking.provider is `{0}`, which this build is without: build Gyre with --features {0}, or set it to `cpu`"
    )]
    NotBuiltIn(Provider),
    /// This machine or this ONNX Runtime cannot do it.
    #[error(
        "masking.provider is `{provider}`, but ONNX Runtime cannot use it here: {reason}; `cpu` always works"
    )]
    Provider {
        /// Who was to compute.
        provider: Provider,
        /// What ONNX Runtime said.
        reason: String,
    },
    /// ONNX Runtime refuses the model.
    #[error("ONNX Runtime cannot load {path}: {reason}")]
    Load {
        /// The model's file.
        path: PathBuf,
        /// What ONNX Runtime said.
        reason: String,
    },
    /// ONNX Runtime does not know the model's operators.
    #[error(
        "{path} has operators of version {opset}, and this ONNX Runtime knows them up to {known}: export it again with opset={known}, or use a newer ONNX Runtime"
    )]
    Opset {
        /// The model's file.
        path: PathBuf,
        /// What its card says.
        opset: u32,
        /// The newest version that would do.
        known: String,
    },
    /// The model is not a mask, or not one for these rasters.
    #[error(
        "{path} {has}, but a mask of its card's sizes must have the one {expected}: export it again"
    )]
    Interface {
        /// The model's file.
        path: PathBuf,
        /// What it has.
        has: String,
        /// What it must have.
        expected: String,
    },
    /// The network does not run.
    #[error("the learned mask cannot be computed: {0}")]
    Run(String),
}

/// A network that makes masks of rasters.
#[derive(Debug)]
pub struct Network {
    session: Session,
    /// scans x n x n.
    masks: Array3<f32>,
}

impl Network {
    /// Loads the model that the configuration names, and checks that it fits these rasters.
    ///
    /// # Errors
    /// A model that does not fit, ONNX Runtime missing or refusing it.
    pub fn load(config: &MaskingConfig, raster: &RasterConfig) -> Result<Self, NetworkError> {
        let model = Model::read(config, raster)?;
        let environment = runtime::open(&runtime::find(config.runtime.as_deref())?)?;
        let mut builder = builder(&environment, config)?;
        let session = builder
            .commit_from_memory(&model.bytes)
            .map_err(|error| refused(&model, error.message()))?;
        let shape = [1, model.card.model.inputs, raster.n, raster.n];
        check("takes", INPUT, session.inputs(), shape, &model)?;
        check("gives", OUTPUT, session.outputs(), shape, &model)?;
        let [_, scans, rows, columns] = shape;
        Ok(Self {
            session,
            masks: Array3::zeros((scans, rows, columns)),
        })
    }

    /// Scans that it looks at, and masks that it makes of them: 1, or 2 (this scan, then the one before).
    pub fn scans(&self) -> usize {
        self.masks.len_of(Axis(0))
    }

    /// Computes the masks (scans x n x n) of rasters (scans x n x n): factors from 0 (counts as nothing) to 1 (counts in
    /// full). Values of the network beyond that range are clamped to it.
    ///
    /// # Errors
    /// Rasters of the wrong shape, what ONNX Runtime reports, and factors that are NaN.
    pub fn run(
        &mut self,
        rasters: ArrayView3<'_, f32>,
    ) -> Result<ArrayView3<'_, f32>, NetworkError> {
        let failed = |error: ort::Error| NetworkError::Run(sentence(error.message()));
        let input = TensorRef::from_array_view(rasters.insert_axis(Axis(0))).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(failed)?;
        let (_, masks) = outputs[0].try_extract_tensor::<f32>().map_err(failed)?;
        if masks.len() != self.masks.len() {
            return Err(NetworkError::Run(format!(
                "{} values instead of {}",
                masks.len(),
                self.masks.len()
            )));
        }
        self.masks
            .iter_mut()
            .zip(masks)
            .for_each(|(kept, mask)| *kept = mask.clamp(0.0, 1.0));
        match self.masks.iter().filter(|mask| mask.is_nan()).count() {
            0 => Ok(self.masks.view()),
            count => Err(NetworkError::Run(format!(
                "{count} of {} factors are NaN, so the model or its execution provider is broken; \
                 get the model again, or set masking.provider to `cpu`",
                self.masks.len()
            ))),
        }
    }

    /// The masks of the last [`Network::run`], scans x n x n.
    pub fn masks(&self) -> ArrayView3<'_, f32> {
        self.masks.view()
    }
}

/// Single runs, deterministic to the bit.
fn builder(
    environment: &Environment,
    config: &MaskingConfig,
) -> Result<SessionBuilder, NetworkError> {
    let providers = execution_providers(config.provider)?;
    let build = || -> ort::Result<SessionBuilder> {
        let builder = Session::builder(environment)?
            .with_intra_threads(config.threads)?
            .with_inter_threads(1)?;
        // The other stages need the processor while there is no scan.
        Ok(builder
            .with_intra_op_spinning(false)?
            .with_deterministic_compute(true)?)
    };
    let builder = build().map_err(|error| NetworkError::Run(sentence(error.message())))?;
    builder
        .with_execution_providers(providers)
        .map_err(|error| NetworkError::Provider {
            provider: config.provider,
            reason: sentence(error.message()),
        })
}

fn execution_providers(provider: Provider) -> Result<Vec<ExecutionProviderDispatch>, NetworkError> {
    match provider {
        Provider::Cpu => Ok(Vec::new()),
        #[cfg(feature = "cuda")]
        Provider::Cuda => Ok(vec![ort::ep::CUDA::default().build().error_on_failure()]),
        #[cfg(feature = "tensorrt")]
        Provider::Tensorrt => Ok(vec![
            ort::ep::TensorRT::default().build().error_on_failure(),
        ]),
        #[cfg(feature = "openvino")]
        Provider::Openvino => Ok(vec![
            ort::ep::OpenVINO::default().build().error_on_failure(),
        ]),
        #[allow(unreachable_patterns, reason = "none is left where all are built in")]
        other => Err(NetworkError::NotBuiltIn(other)),
    }
}

/// Whether what the session takes or gives is the one tensor that it must be.
fn check(
    verb: &str,
    name: &str,
    tensors: &[Outlet],
    shape: [usize; 4],
    model: &Model,
) -> Result<(), NetworkError> {
    let fits = |tensor: &Outlet| match tensor.dtype() {
        ValueType::Tensor {
            ty: TensorElementType::Float32,
            shape: actual,
            ..
        } => tensor.name() == name && actual.iter().copied().eq(shape.map(|size| size as i64)),
        _ => false,
    };
    match tensors {
        [tensor] if fits(tensor) => Ok(()),
        _ => Err(NetworkError::Interface {
            path: model.file.clone(),
            has: format!(
                "{verb} {}",
                tensors
                    .iter()
                    .map(describe)
                    .collect::<Vec<_>>()
                    .join(" and ")
            ),
            expected: format!("`{name}` Float32 {shape:?}"),
        }),
    }
}

fn describe(tensor: &Outlet) -> String {
    match tensor.dtype() {
        ValueType::Tensor { ty, shape, .. } => format!("`{}` {ty:?} {shape}", tensor.name()),
        _ => format!("`{}`, which is no tensor", tensor.name()),
    }
}

/// Why ONNX Runtime does not load the model.
fn refused(model: &Model, message: &str) -> NetworkError {
    let path = model.file.clone();
    match message.split_once("ai.onnx is till opset ") {
        Some((_, known)) => {
            let known = known.trim_end().trim_end_matches('.').to_owned();
            NetworkError::Opset {
                path,
                opset: model.card.model.opset,
                known,
            }
        }
        None => NetworkError::Load {
            path,
            reason: sentence(message),
        },
    }
}

/// What ONNX Runtime said, as one line and without the place in its own source that it said it from.
fn sentence(message: &str) -> String {
    let said = match message.split_once("/onnxruntime_src/") {
        Some((_, place)) => place.split_once(") ").map_or(place, |(_, said)| said),
        None => message,
    };
    said.trim_end_matches(['.', '\n'])
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_onnx_runtime_says_is_one_line_without_its_own_source() {
        let said = "Load failed:/onnxruntime_src/core/graph.cc:46 void check(int, bool) Opset 99 is (still)\nnew. Or not.\n";
        assert_eq!(sentence(said), "Opset 99 is (still) new. Or not");
        assert_eq!(
            sentence("Protobuf\n  parsing failed."),
            "Protobuf parsing failed"
        );
    }
}
