//! A network in tract.

use std::sync::Arc;

use ndarray::{ArrayView3, ArrayViewMut3};
use tract_onnx::{
    pb::ModelProto,
    prelude::{
        DatumType, Framework, InferenceModel, InferenceModelExt, IntoRunnable, OutletId, Tensor,
        TractError, TractResult, TypedModel, TypedRunnableModel, tvec,
    },
};

use super::{NetworkError, fill, floating_point::keep_activations_in_floating_point, one_line};
use crate::{Backend, model::Model};

/// The newest operators that tract is tested with.
const OPSET: i64 = 18;

/// An optimised network. One thread computes it.
#[derive(Debug)]
pub(super) struct Tract {
    plan: Arc<TypedRunnableModel>,
    inputs: Vec<String>,
    outputs: Vec<String>,
}

impl Tract {
    /// Loads a model.
    pub fn load(model: &Model) -> Result<Self, NetworkError> {
        let rejected = |error: TractError| NetworkError::Load {
            by: Backend::Tract,
            path: model.file.clone(),
            reason: sentence(&error),
        };
        let onnx = tract_onnx::onnx();
        let file = onnx.proto_model_for_read(&mut &model.bytes[..]);
        let mut file = file.map_err(rejected)?;
        if let Some(graph) = &mut file.graph {
            keep_activations_in_floating_point(graph);
        }
        match newest_operators(&file) {
            opset if opset > OPSET => Err(NetworkError::Opset {
                path: model.file.clone(),
                opset,
                by: Backend::Tract,
                known: OPSET.to_string(),
            }),
            _ => onnx
                .model_for_proto_model(&file)
                .and_then(Self::optimise)
                .map_err(rejected),
        }
    }

    fn optimise(model: InferenceModel) -> TractResult<Self> {
        let names = [model.input_outlets()?, model.output_outlets()?].map(|outlets| {
            let name = |outlet: &OutletId| match model.outlet_label(*outlet) {
                Some(label) => label.to_owned(),
                None => model.node(outlet.node).name.clone(),
            };
            outlets.iter().map(name).collect::<Vec<_>>()
        });
        let typed = model.into_typed()?;
        let [inputs, outputs] = names;
        let (inputs, outputs) = (
            describe(&typed, &inputs, typed.input_outlets()?)?,
            describe(&typed, &outputs, typed.output_outlets()?)?,
        );
        let plan = typed.into_optimized()?.into_runnable()?;
        Ok(Self {
            plan,
            inputs,
            outputs,
        })
    }

    /// Returns the name, type and shape of each input.
    pub fn inputs(&self) -> Vec<String> {
        self.inputs.clone()
    }

    /// Returns the name, type and shape of each output.
    pub fn outputs(&self) -> Vec<String> {
        self.outputs.clone()
    }

    /// Computes the masks of rasters, both scans x n x n.
    pub fn run(
        &mut self,
        rasters: ArrayView3<'_, f32>,
        masks: ArrayViewMut3<'_, f32>,
    ) -> Result<(), NetworkError> {
        let failed = |error: TractError| NetworkError::Run(sentence(&error));
        let (scans, rows, columns) = rasters.dim();
        let rasters = rasters.as_standard_layout();
        let input = Tensor::from_shape(
            &[1, scans, rows, columns],
            rasters.as_slice().unwrap_or(&[]),
        );
        let outputs = input
            .and_then(|input| self.plan.run(tvec![input.into()]))
            .map_err(failed)?;
        let computed = outputs[0].try_as_plain_ram().map_err(failed)?;
        fill(masks, computed.as_slice::<f32>().map_err(failed)?)
    }
}

/// Returns the version of ONNX's own operators.
fn newest_operators(file: &ModelProto) -> i64 {
    let own = file
        .opset_import
        .iter()
        .filter(|import| matches!(&*import.domain, "" | "ai.onnx"));
    own.map(|import| import.version).max().unwrap_or(0)
}

fn describe(
    model: &TypedModel,
    names: &[String],
    outlets: &[OutletId],
) -> TractResult<Vec<String>> {
    let describe = |(name, outlet): (&String, &OutletId)| {
        let fact = model.outlet_fact(*outlet)?;
        let kind = match fact.datum_type {
            DatumType::F32 => "Float32".to_owned(),
            other => format!("{other:?}"),
        };
        let sizes: Vec<_> = fact.shape.iter().map(ToString::to_string).collect();
        Ok(format!("`{name}` {kind} [{}]", sizes.join(", ")))
    };
    names.iter().zip(outlets).map(describe).collect()
}

/// Returns an error and its causes as one line.
fn sentence(error: &TractError) -> String {
    one_line(&format!("{error:#}"))
}
