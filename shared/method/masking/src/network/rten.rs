use rten::ModelOptions;
use rten_onnx::onnx::{
    AttributeProto, AttributeType, DataType, Dimension, GraphProto, ModelProto, ValueInfoProto,
};

use super::NetworkError;
use crate::networks::planes::{Engine, guarded};
use crate::{Backend, model::Model};

/// The newest operator version where the models of `models/` agree with ONNX Runtime.
const OPSET: i64 = 26;

fn parse(model: &Model) -> Result<ModelProto, NetworkError> {
    let file = guarded(|| ModelProto::parse_buf(&model.bytes)).map_err(|error| {
        let reason = format!("it is not a model in ONNX, or is damaged: {error}");
        rejected(model, &reason)
    })?;
    let opset = newest_operators(&file);
    if opset > OPSET {
        return Err(NetworkError::opset(
            Backend::Rten,
            model,
            opset,
            &OPSET.to_string(),
        ));
    }
    match file.graph {
        Some(_) => Ok(file),
        None => Err(rejected(model, "it has no graph")),
    }
}

pub(super) fn rejected(model: &Model, reason: &str) -> NetworkError {
    NetworkError::load(Backend::Rten, model, reason)
}

/// Loads a network into rten; returns the names of the model's inputs and outputs too. Only when it
/// computes does rten find operators that do not fit each other.
pub(super) fn load(model: &Model) -> Result<(Engine, Vec<String>, Vec<String>), NetworkError> {
    let mut file = parse(model)?;
    let (inputs, outputs) = (inputs(&file), outputs(&file));
    if let Some(graph) = &mut file.graph {
        state_kernel_sizes(graph);
    }
    let rejected = |reason: String| rejected(model, &reason);
    let bytes = guarded(|| file.write_buf()).map_err(rejected)?;
    let network = guarded(|| ModelOptions::with_all_ops().load(bytes)).map_err(rejected)?;
    Ok((Engine::of_rten(network), inputs, outputs))
}

fn newest_operators(file: &ModelProto) -> i64 {
    let own = file
        .opset_import
        .iter()
        .filter(|import| matches!(import.domain.as_deref(), None | Some("" | "ai.onnx")));
    own.filter_map(|import| import.version).max().unwrap_or(0)
}

/// Adds the sizes of kernels to convolutions that leave them out. In ONNX the weights state them
/// too, but rten does not look there.
fn state_kernel_sizes(graph: &mut GraphProto) {
    const NAME: &str = "kernel_shape";
    for node in &mut graph.node {
        let is_convolution = matches!(
            node.op_type.as_deref(),
            Some("Conv" | "ConvInteger" | "ConvTranspose")
        );
        let mut attributes = node.attribute.iter();
        if !is_convolution || attributes.any(|it| it.name.as_deref() == Some(NAME)) {
            continue;
        }
        let name = node.input.get(1);
        let weights = graph.initializer.iter().find(|it| it.name.as_ref() == name);
        let sizes = weights.and_then(|weights| weights.dims.get(2..));
        node.attribute.extend(sizes.map(|sizes| AttributeProto {
            name: Some(NAME.to_owned()),
            ints: sizes.to_vec(),
            r#type: Some(AttributeType::INTS),
            ..AttributeProto::default()
        }));
    }
}

fn inputs(file: &ModelProto) -> Vec<String> {
    let Some(graph) = &file.graph else {
        return Vec::new();
    };
    let is_weight = |input: &&ValueInfoProto| {
        let mut weights = graph.initializer.iter();
        weights.any(|weight| weight.name == input.name)
    };
    let inputs = graph.input.iter().filter(|input| !is_weight(input));
    inputs.map(describe).collect()
}

fn outputs(file: &ModelProto) -> Vec<String> {
    let outputs = file.graph.iter().flat_map(|graph| &graph.output);
    outputs.map(describe).collect()
}

fn describe(tensor: &ValueInfoProto) -> String {
    let name = tensor.name.as_deref().unwrap_or_default();
    let kind = tensor.r#type.as_ref();
    let Some(tensor) = kind.and_then(|kind| kind.tensor_type.as_ref()) else {
        return format!("`{name}`, which is not a tensor");
    };
    let kind = match tensor.elem_type {
        Some(DataType::FLOAT) => "Float32".to_owned(),
        Some(other) => other.to_string(),
        None => "untyped".to_owned(),
    };
    let size = |size: &Dimension| match (size.dim_value, &size.dim_param) {
        (Some(size), _) => size.to_string(),
        (None, Some(name)) => name.clone(),
        (None, None) => "?".to_owned(),
    };
    let sizes = tensor.shape.iter().flat_map(|shape| &shape.dim);
    let sizes: Vec<_> = sizes.map(size).collect();
    format!("`{name}` {kind} [{}]", sizes.join(", "))
}
