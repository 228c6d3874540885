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

/// An error in loading or running a network.
#[derive(Debug, Error)]
pub enum NetworkError {
    /// The model cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// ONNX Runtime cannot be used.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// This build does not have the execution provider.
    #[error(
        "masking.provider is `{0}`, which this build does not have: build Gyre with --features {0}, or set it to `cpu`"
    )]
    NotBuiltIn(Provider),
    /// The execution provider does not work on this machine or with this ONNX Runtime.
    #[error(
        "masking.provider is `{provider}`, but ONNX Runtime cannot use it here: {reason}; `cpu` always works"
    )]
    Provider {
        /// The execution provider.
        provider: Provider,
        /// ONNX Runtime's error.
        reason: String,
    },
    /// ONNX Runtime rejects the model.
    #[error("ONNX Runtime cannot load {path}: {reason}")]
    Load {
        /// The model's file.
        path: PathBuf,
        /// ONNX Runtime's error.
        reason: String,
    },
    /// ONNX Runtime does not know the model's operators.
    #[error(
        "{path} has operators of version {opset}, and this ONNX Runtime knows them up to {known}: export it again with opset={known}, or use a newer ONNX Runtime"
    )]
    Opset {
        /// The model's file.
        path: PathBuf,
        /// The version in its card.
        opset: u32,
        /// The newest version that ONNX Runtime supports.
        known: String,
    },
    /// The inputs or outputs of the model do not fit its card.
    #[error("{path} {has}, but by its card it must have only {expected}: export it again")]
    Interface {
        /// The model's file.
        path: PathBuf,
        /// The actual tensors.
        has: String,
        /// The expected tensor.
        expected: String,
    },
    /// The network fails.
    #[error("the learned mask cannot be computed: {0}")]
    Run(String),
}

/// A network that computes masks from rasters.
#[derive(Debug)]
pub struct Network {
    session: Session,
    /// The last masks, scans x n x n.
    masks: Array3<f32>,
}

impl Network {
    /// Loads the configured model and checks that it fits these rasters.
    ///
    /// # Errors
    /// A model that does not fit, or ONNX Runtime is missing or rejects it.
    pub fn load(config: &MaskingConfig, raster: &RasterConfig) -> Result<Self, NetworkError> {
        let model = Model::read(config, raster)?;
        let environment = runtime::open(&runtime::find(config.runtime.as_deref())?)?;
        let mut builder = builder(&environment, config)?;
        let session = builder
            .commit_from_memory(&model.bytes)
            .map_err(|error| rejected(&model, error.message()))?;
        let shape = [1, model.card.model.inputs, raster.n, raster.n];
        check("takes", INPUT, session.inputs(), shape, &model)?;
        check("gives", OUTPUT, session.outputs(), shape, &model)?;
        let [_, scans, rows, columns] = shape;
        Ok(Self {
            session,
            masks: Array3::zeros((scans, rows, columns)),
        })
    }

    /// Returns the number of scans that it takes and of masks that it gives: 1, or 2 (this scan, then the previous one).
    pub fn scans(&self) -> usize {
        self.masks.len_of(Axis(0))
    }

    /// Computes the masks (scans x n x n) of rasters (scans x n x n). A mask is a factor from 0 to 1; the network's values are
    /// clamped to that range.
    ///
    /// # Errors
    /// Rasters of the wrong shape, an error of ONNX Runtime, or factors that are NaN.
    pub fn run(
        &mut self,
        rasters: ArrayView3<'_, f32>,
    ) -> Result<ArrayView3<'_, f32>, NetworkError> {
        let failed = |error: ort::Error| NetworkError::Run(one_line(error.message()));
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

    /// Returns the masks of the last [`Network::run`], scans x n x n.
    pub fn masks(&self) -> ArrayView3<'_, f32> {
        self.masks.view()
    }
}

/// Returns a session builder for bitwise reproducible results.
fn builder(
    environment: &Environment,
    config: &MaskingConfig,
) -> Result<SessionBuilder, NetworkError> {
    let providers = execution_providers(config.provider)?;
    let build = || -> ort::Result<SessionBuilder> {
        let builder = Session::builder(environment)?
            .with_intra_threads(config.threads)?
            .with_inter_threads(1)?;
        // No spinning: between scans the other stages need the processor.
        Ok(builder
            .with_intra_op_spinning(false)?
            .with_deterministic_compute(true)?)
    };
    let builder = build().map_err(|error| NetworkError::Run(one_line(error.message())))?;
    builder
        .with_execution_providers(providers)
        .map_err(|error| NetworkError::Provider {
            provider: config.provider,
            reason: one_line(error.message()),
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
        #[allow(
            unreachable_patterns,
            reason = "unreachable if all providers are built in"
        )]
        other => Err(NetworkError::NotBuiltIn(other)),
    }
}

/// Checks that the inputs or outputs of a session are exactly the expected tensor.
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
        _ => format!("`{}`, which is not a tensor", tensor.name()),
    }
}

/// Converts the error of a model that ONNX Runtime does not load.
fn rejected(model: &Model, message: &str) -> NetworkError {
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
            reason: one_line(message),
        },
    }
}

/// Returns a message of ONNX Runtime as one line, without the location in its source code.
fn one_line(message: &str) -> String {
    let text = match message.split_once("/onnxruntime_src/") {
        Some((_, location)) => location.split_once(") ").map_or(location, |(_, text)| text),
        None => message,
    };
    text.trim_end_matches(['.', '\n'])
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_onnx_runtime_become_one_line_without_source_location() {
        let message = "Load failed:/onnxruntime_src/core/graph.cc:46 void check(int, bool) Opset 99 is (still)\nnew. Or not.\n";
        assert_eq!(one_line(message), "Opset 99 is (still) new. Or not");
        assert_eq!(
            one_line("Protobuf\n  parsing failed."),
            "Protobuf parsing failed"
        );
    }
}
