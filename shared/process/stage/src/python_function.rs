//! A function in a file of Python, called from Rust.
//!
//! The function lives in a process of its own, an interpreter with numpy that ends with its caller.
//! A call writes a line of JSON and the arrays to its standard input, and reads a line and the
//! array that it returns: a scan of 1.5 MB takes about a millisecond. So any Python will do, its
//! crash is not the stage's, and no interpreter is linked.

mod interpreter;

use std::{
    io::{BufRead, BufReader, BufWriter, ErrorKind, Read, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio},
};

use crate::StageError;
use ndarray::{Array2, ArrayViewD};
use serde_json::{Map, Value, json};
use thiserror::Error;

pub use interpreter::{Interpreter, NoInterpreter};

/// The program of the interpreter's side.
const PROGRAM: &str = include_str!("python_function/function.py");
/// Room in the pipes, bytes: the most that a process may ask for without privileges.
const PIPE_BYTES: usize = 1 << 20;

/// A function that cannot be called, or that has failed.
#[derive(Debug, Error)]
pub enum FunctionError {
    #[error("there is no file {0}")]
    Missing(PathBuf),
    #[error(
        "cannot start {python} for {file}: {source}; install Python 3, or name one with GYRE_PYTHON"
    )]
    Start {
        python: String,
        /// The file of the function.
        file: PathBuf,
        source: std::io::Error,
    },
    #[error(
        "{python} has ended before it had loaded {file}: {status}; name a Python of version 3 with \
         GYRE_PYTHON, and see that the file does not end it"
    )]
    NotLoaded {
        python: String,
        /// The file of the function.
        file: PathBuf,
        status: ExitStatus,
    },
    /// The interpreter was killed while it loaded the file, or has ended in the middle of a call.
    #[error("Python has ended while it worked for {file}: {status}")]
    Ended {
        /// The file of the function.
        file: PathBuf,
        /// The exit code or the signal.
        status: String,
    },
    /// An exception: the file, its line, and Python's message. The traceback is on standard error.
    #[error("{0}")]
    Exception(String),
}

impl From<FunctionError> for StageError {
    /// For a function that is loaded: another attempt helps where a process was killed or not to
    /// be had.
    fn from(error: FunctionError) -> Self {
        let sentence = error.to_string();
        match error {
            FunctionError::Start { source, .. } if !is_no_program(&source) => {
                Self::Function(sentence)
            }
            FunctionError::Ended { .. } => Self::Function(sentence),
            _ => Self::Configuration(sentence),
        }
    }
}

fn is_no_program(error: &std::io::Error) -> bool {
    let kinds = [ErrorKind::NotFound, ErrorKind::PermissionDenied];
    kinds.contains(&error.kind())
}

/// The name of a function, which implies its arguments and results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Name {
    /// `mask(scan)`: factors from 0 to 1.
    Mask,
    /// `rotation(scan, previous)`: an angle, rad, and its standard deviation.
    Rotation,
    /// `translation(scan, previous, rotation_rad)`: x, y, m, and their standard deviation or
    /// covariance.
    Translation,
}

impl Name {
    /// Returns the name as Python has it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mask => "mask",
            Self::Rotation => "rotation",
            Self::Translation => "translation",
        }
    }
}

/// An argument of a call.
pub enum Argument<'a> {
    Number(f64),
    Scan(Scan<'a>),
}

/// The attributes of a scan.
pub struct Scan<'a> {
    pub values: Map<String, Value>,
    pub arrays: Vec<(&'static str, Array<'a>)>,
}

/// An array that is sent as it lies in memory.
pub enum Array<'a> {
    Bytes(ArrayViewD<'a, u8>),
    Floats(ArrayViewD<'a, f32>),
}

/// The result of a call.
#[derive(Debug)]
pub enum Returned {
    Values(Vec<f64>),
    /// Factors, and the array of the scan whose shape they have.
    Factors(Array2<f32>, String),
}

/// A function of Python that is ready to be called.
#[derive(Debug)]
pub struct Function {
    file: PathBuf,
    python: Child,
    requests: BufWriter<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Function {
    /// Starts the interpreter that `GYRE_PYTHON` names, or `python3`, and loads the file.
    pub fn load(file: &Path, name: Name) -> Result<Self, FunctionError> {
        let absolute = std::path::absolute(file).ok().filter(|file| file.is_file());
        let file = absolute.ok_or_else(|| FunctionError::Missing(file.to_owned()))?;
        let python = interpreter::name();
        let start = |source| FunctionError::Start {
            python: python.clone(),
            file: file.clone(),
            source,
        };
        let mut command = Command::new(&python);
        command
            .args(["-u", "-c", PROGRAM])
            .arg(&file)
            .arg(name.as_str());
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(start)?;
        let (Some(requests), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(start(ErrorKind::BrokenPipe.into()));
        };
        // Smaller ones work too.
        let _ = rustix::pipe::fcntl_setpipe_size(&requests, PIPE_BYTES);
        let _ = rustix::pipe::fcntl_setpipe_size(&answers, PIPE_BYTES);
        let mut function = Self {
            file,
            python: child,
            requests: BufWriter::new(requests),
            answers: BufReader::with_capacity(PIPE_BYTES, answers),
        };
        match (function.answer(), function.python.try_wait()) {
            (Err(FunctionError::Ended { file, .. }), Ok(Some(status)))
                if status.code().is_some() =>
            {
                Err(FunctionError::NotLoaded {
                    python,
                    file,
                    status,
                })
            }
            (answer, _) => answer.map(|_| function),
        }
    }

    pub fn call(&mut self, arguments: &[Argument<'_>]) -> Result<Returned, FunctionError> {
        if self.send(arguments).is_err() {
            return Err(self.ended());
        }
        let header = self.answer()?;
        if let Some(values) = header["values"].as_array() {
            let values = values.iter().filter_map(Value::as_f64);
            return Ok(Returned::Values(values.collect()));
        }
        let size = |axis: usize| header["shape"][axis].as_u64().unwrap_or_default() as usize;
        let shape = (size(0), size(1));
        let factors = match header["kind"] == "u1" {
            true => self.array::<u8>(shape).map(|array| array.mapv(f32::from)),
            false => self.array::<f32>(shape),
        };
        let of = header["of"].as_str().unwrap_or_default();
        factors
            .map(|factors| Returned::Factors(factors, of.to_owned()))
            .ok_or_else(|| self.ended())
    }

    fn send(&mut self, arguments: &[Argument<'_>]) -> std::io::Result<()> {
        let described: Vec<Value> = arguments.iter().map(Argument::described).collect();
        writeln!(self.requests, "{}", Value::Array(described))?;
        for argument in arguments {
            let Argument::Scan(scan) = argument else {
                continue;
            };
            for (_, array) in &scan.arrays {
                array.write(&mut self.requests)?;
            }
        }
        self.requests.flush()
    }

    /// Reads an array; `None` if the interpreter has ended before its end.
    fn array<T: bytemuck::Pod>(&mut self, shape: (usize, usize)) -> Option<Array2<T>> {
        let mut array = Array2::from_elem(shape, T::zeroed());
        let cells = array.as_slice_mut()?;
        self.answers
            .read_exact(bytemuck::cast_slice_mut(cells))
            .ok()?;
        Some(array)
    }

    fn answer(&mut self) -> Result<Value, FunctionError> {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line);
        let header = read.ok().and_then(|_| serde_json::from_str(&line).ok());
        let header: Value = header.ok_or_else(|| self.ended())?;
        match header["error"].as_str() {
            Some(sentence) => Err(FunctionError::Exception(sentence.to_owned())),
            None => Ok(header),
        }
    }

    fn ended(&mut self) -> FunctionError {
        let status = self.python.wait().map(|status| status.to_string());
        FunctionError::Ended {
            file: self.file.clone(),
            status: status.unwrap_or_else(|error| error.to_string()),
        }
    }
}

impl Drop for Function {
    fn drop(&mut self) {
        // It may be in the middle of a call.
        let _ = self.python.kill();
        let _ = self.python.wait();
    }
}

impl Argument<'_> {
    fn described(&self) -> Value {
        match self {
            Self::Number(number) => json!(number),
            Self::Scan(scan) => {
                let arrays = scan.arrays.iter().map(|(name, array)| {
                    let (kind, shape) = match array {
                        Array::Bytes(array) => ("u1", array.shape()),
                        Array::Floats(array) => ("f4", array.shape()),
                    };
                    json!([name, kind, shape])
                });
                json!({ "values": scan.values, "arrays": arrays.collect::<Vec<_>>() })
            }
        }
    }
}

impl Array<'_> {
    /// Writes the values row by row, without what lies between rows.
    fn write(&self, out: &mut impl Write) -> std::io::Result<()> {
        match self {
            Self::Bytes(array) => rows(array, out),
            Self::Floats(array) => rows(array, out),
        }
    }
}

fn rows<T: bytemuck::Pod>(array: &ArrayViewD<'_, T>, out: &mut impl Write) -> std::io::Result<()> {
    for row in array.rows() {
        match row.to_slice() {
            Some(row) => out.write_all(bytemuck::cast_slice(row))?,
            None => out.write_all(bytemuck::cast_slice(&row.to_vec()))?,
        }
    }
    Ok(())
}
