//! A network in the program that is shown planes of cells.

use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use ort::{session::Session, value::TensorRef};
use rten::{Model, ModelOptions, RunOptions, ThreadPool, ValueView};
use thiserror::Error;

use crate::networks::one_line;
use crate::networks::runtime::{self, RuntimeError};

#[derive(Debug, Error)]
pub enum PlanesError {
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    #[error("{network} cannot be computed: {reason}")]
    Network {
        network: &'static str,
        reason: String,
    },
}

/// A network in the program that is shown planes of cells and gives planes. One thread computes it.
#[derive(Debug)]
pub struct PlanesNetwork {
    name: &'static str,
    engine: Engine,
    /// Planes, rows and columns of its input and of its output.
    shown: [usize; 3],
    given: [usize; 3],
}

#[derive(Debug)]
enum Engine {
    OnnxRuntime(Session),
    Rten(Box<Model>, Arc<ThreadPool>),
}

impl PlanesNetwork {
    /// Loads the network of a name in `gyre_shipped`, into the ONNX Runtime at a path or, without
    /// one, into rten, which takes several times as long.
    pub fn load(
        name: &'static str,
        runtime: Option<&Path>,
        shapes: [[usize; 3]; 2],
    ) -> Result<Self, PlanesError> {
        let bytes = gyre_shipped::bytes(Path::new(name)).unwrap_or_default();
        Self::of(name, bytes, runtime, shapes)
    }

    pub fn of(
        name: &'static str,
        bytes: &'static [u8],
        runtime: Option<&Path>,
        [shown, given]: [[usize; 3]; 2],
    ) -> Result<Self, PlanesError> {
        let engine = match runtime {
            Some(path) => {
                let environment = runtime::open(path)?;
                let session = runtime::session(&environment, 1)
                    .and_then(|mut builder| builder.commit_from_memory(bytes));
                session
                    .map(Engine::OnnxRuntime)
                    .map_err(|it| one_line(it.message()))
            }
            None => {
                let model = ModelOptions::with_all_ops().load_static_slice(bytes);
                let thread = Arc::new(ThreadPool::with_num_threads(1));
                let model = model.map_err(|error| error.to_string());
                model.map(|model| Engine::Rten(Box::new(model), thread))
            }
        };
        Ok(Self {
            name,
            engine: engine.map_err(|reason| failed(name, reason))?,
            shown,
            given,
        })
    }

    pub fn compute(&mut self, planes: &[f32]) -> Result<Vec<f32>, PlanesError> {
        let [depth, rows, columns] = self.shown;
        let shape = [1, depth, rows, columns];
        let (given, values) = match &mut self.engine {
            Engine::OnnxRuntime(session) => by_onnx_runtime(session, shape, planes),
            Engine::Rten(model, thread) => by_rten(model, thread, shape, planes),
        }
        .map_err(|reason| failed(self.name, reason))?;
        match given.strip_prefix(&[1]) == Some(&self.given) {
            true => Ok(values),
            false => Err(failed(self.name, format_args!("it gives {given:?}"))),
        }
    }
}

fn failed(network: &'static str, reason: impl Display) -> PlanesError {
    PlanesError::Network {
        network,
        reason: reason.to_string(),
    }
}

type Given = (Vec<usize>, Vec<f32>);

fn by_onnx_runtime(
    session: &mut Session,
    shape: [usize; 4],
    planes: &[f32],
) -> Result<Given, String> {
    let mut compute = || -> ort::Result<Given> {
        let input = TensorRef::from_array_view((shape, planes))?;
        let outputs = session.run(ort::inputs![input])?;
        let (shape, values) = outputs[0].try_extract_tensor::<f32>()?;
        let shape = shape.iter().map(|side| *side as usize).collect();
        Ok((shape, values.to_vec()))
    };
    compute().map_err(|error| one_line(error.message()))
}

/// Computes a network in rten. Returns the shape and the values of its output.
pub(crate) fn by_rten(
    model: &Model,
    thread: &Arc<ThreadPool>,
    shape: [usize; 4],
    planes: &[f32],
) -> Result<Given, String> {
    let input = ValueView::from_shape(shape, planes).map_err(|error| error.to_string())?;
    let options = RunOptions::default().with_thread_pool(Some(thread.clone()));
    let output = model.run_one(input.into(), Some(options));
    let output = output.map_err(|error| error.to_string())?;
    let output = output.into_shape_vec::<f32, 4>();
    let (shape, values) = output.map_err(|error| error.to_string())?;
    Ok((shape.to_vec(), values))
}
