use std::path::Path;

use ort::{
    environment::Environment,
    ep::ExecutionProviderDispatch,
    session::builder::SessionBuilder,
    value::{Outlet, ValueType},
};

use super::NetworkError;
use crate::networks::{one_line, planes::Engine, runtime};
use crate::{Backend, MaskingConfig, Provider, model::Model};

/// Loads a model. Returns the engine, and the names of the model's inputs and outputs.
pub(super) fn load(
    path: &Path,
    model: &Model,
    config: &MaskingConfig,
) -> Result<(Engine, Vec<String>, Vec<String>), NetworkError> {
    let environment = runtime::open(path)?;
    let session = builder(&environment, config)?
        .commit_from_memory(&model.bytes)
        .map_err(|error| rejected(model, error.message()))?;
    let [inputs, outputs] =
        [session.inputs(), session.outputs()].map(|tensors| tensors.iter().map(describe).collect());
    Ok((Engine::OnnxRuntime(session), inputs, outputs))
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
