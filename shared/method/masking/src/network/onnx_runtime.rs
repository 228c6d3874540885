use std::path::Path;

use ndarray::{ArrayView3, ArrayViewMut3, Axis};
use ort::{
    environment::Environment,
    ep::ExecutionProviderDispatch,
    session::{Session, builder::SessionBuilder},
    value::{Outlet, TensorRef, ValueType},
};

use super::{NetworkError, fill};
use crate::networks::{one_line, runtime};
use crate::{Backend, MaskingConfig, Provider, model::Model};

#[derive(Debug)]
pub(super) struct OnnxRuntime {
    session: Session,
}

impl OnnxRuntime {
    pub fn load(path: &Path, model: &Model, config: &MaskingConfig) -> Result<Self, NetworkError> {
        let environment = runtime::open(path)?;
        let session = builder(&environment, config)?
            .commit_from_memory(&model.bytes)
            .map_err(|error| rejected(model, error.message()))?;
        Ok(Self { session })
    }

    pub fn inputs(&self) -> Vec<String> {
        self.session.inputs().iter().map(describe).collect()
    }

    pub fn outputs(&self) -> Vec<String> {
        self.session.outputs().iter().map(describe).collect()
    }

    pub fn run(
        &mut self,
        rasters: ArrayView3<'_, f32>,
        masks: ArrayViewMut3<'_, f32>,
    ) -> Result<(), NetworkError> {
        let failed = |error: ort::Error| NetworkError::Run(one_line(error.message()));
        let input = TensorRef::from_array_view(rasters.insert_axis(Axis(0))).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(failed)?;
        let (_, computed) = outputs[0].try_extract_tensor::<f32>().map_err(failed)?;
        fill(masks, computed)
    }
}

fn builder(
    environment: &Environment,
    config: &MaskingConfig,
) -> Result<SessionBuilder, NetworkError> {
    let providers = execution_providers(config.provider)?;
    let builder = runtime::session(environment, config.threads)
        .map_err(|error| NetworkError::Run(one_line(error.message())))?;
    builder
        .with_execution_providers(providers)
        .map_err(|error| {
            let (provider, reason) = (config.provider, one_line(error.message()));
            NetworkError::Model(format!("masking.provider is `{provider}`, but ONNX Runtime cannot use it here: {reason}; `cpu` always works"))
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
        other => Err(NetworkError::Model(format!(
            "masking.provider is `{other}`, which this build does not have: build Gyre with --features {other}, or set it to `cpu`"
        ))),
    }
}

fn describe(tensor: &Outlet) -> String {
    match tensor.dtype() {
        ValueType::Tensor { ty, shape, .. } => format!("`{}` {ty:?} {shape}", tensor.name()),
        _ => format!("`{}`, which is not a tensor", tensor.name()),
    }
}

fn rejected(model: &Model, message: &str) -> NetworkError {
    match message.split_once("ai.onnx is till opset ") {
        Some((_, known)) => {
            let known = known.trim_end().trim_end_matches('.');
            NetworkError::opset(
                Backend::OnnxRuntime,
                model,
                model.card.model.opset.into(),
                known,
            )
        }
        None => NetworkError::load(Backend::OnnxRuntime, model, &one_line(message)),
    }
}
