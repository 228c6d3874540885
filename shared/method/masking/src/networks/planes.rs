//! A network in the program that is shown planes of cells.

use std::{
    borrow::Cow,
    error::Error,
    fmt::Display,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    sync::Arc,
};

use ort::{session::Session, value::TensorRef};
use rten::{Model, ModelOptions, RunOptions, ThreadPool, ValueView};
use thiserror::Error;

use crate::networks::{
    one_line,
    runtime::{self, RuntimeError},
};

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
pub(crate) enum Engine {
    OnnxRuntime(Session),
    Rten(Box<Model>, Arc<ThreadPool>),
}

impl PlanesNetwork {
    /// Loads the network of a name in `gyre_storage::shipped`, into the ONNX Runtime at a path or,
    /// without one, into rten, which takes several times as long.
    pub fn load(
        name: &'static str,
        runtime: Option<&Path>,
        shapes: [[usize; 3]; 2],
    ) -> Result<Self, PlanesError> {
        let bytes = gyre_storage::shipped::bytes(Path::new(name)).unwrap_or_default();
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
                let model = model.map_err(|error| error.to_string());
                model.map(Engine::of_rten)
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
        let computed = self.engine.compute(shape, planes, |given, values| {
            let given: Vec<_> = given.iter().map(|side| *side as usize).collect();
            (given, values.into_owned())
        });
        let (given, values) = computed.map_err(|reason| failed(self.name, reason))?;
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

impl Engine {
    /// One thread computes the network.
    pub fn of_rten(model: Model) -> Self {
        Self::Rten(Box::new(model), Arc::new(ThreadPool::with_num_threads(1)))
    }

    /// Computes a network; only the libraries allocate. `take` gets the shape and the values of its
    /// output.
    pub fn compute<T>(
        &mut self,
        shape: [usize; 4],
        planes: &[f32],
        take: impl FnOnce(&[i64], Cow<'_, [f32]>) -> T,
    ) -> Result<T, String> {
        match self {
            Self::OnnxRuntime(session) => {
                let compute = || -> ort::Result<T> {
                    let input = TensorRef::from_array_view((shape, planes))?;
                    let outputs = session.run(ort::inputs![input])?;
                    let (shape, values) = outputs[0].try_extract_tensor::<f32>()?;
                    Ok(take(shape, values.into()))
                };
                compute().map_err(|error| one_line(error.message()))
            }
            Self::Rten(model, thread) => {
                let options = RunOptions::default().with_thread_pool(Some(thread.clone()));
                let run = || -> Result<_, Box<dyn Error>> {
                    let input = ValueView::from_shape(shape, planes)?;
                    let output = model.run_one(input.into(), Some(options))?;
                    Ok(output.into_shape_vec::<f32, 4>()?)
                };
                let (shape, values) = guarded(run)?;
                Ok(take(&shape.map(|side| side as i64), values.into()))
            }
        }
    }
}

/// Calls rten, or what reads a model. A model may have what that does not expect, and then it
/// panics: this becomes an error too.
pub(crate) fn guarded<T, E: Display>(call: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(result) => result.map_err(|error| one_line(&error.to_string())),
        Err(_) => Err("it fails on this model".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_rten_becomes_an_error() {
        let panics = || -> Result<(), String> { panic!("as rten may") };
        assert_eq!(guarded(panics), Err("it fails on this model".to_owned()));
    }
}
