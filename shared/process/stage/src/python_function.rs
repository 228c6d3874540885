//! A function in a file of Python, called from Rust in a process of its own: a call writes a line
//! of JSON and the arrays, and reads a line and the array that it returns. A scan of 1.5 MB takes
//! about a millisecond. Any Python will do, its crash is not the stage's, and none is linked.

use std::{
    env,
    io::{BufRead, BufReader, BufWriter, ErrorKind, Read, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

use gyre_transport::RunError;
use ndarray::{Array2, ArrayViewD};
use serde::Deserialize;
use serde_json::{Map, Value, json};

const PROGRAM: &str = include_str!("python_function/function.py");
/// Room in the pipes, bytes: the most that a process may ask for without privileges.
const PIPE_BYTES: usize = 1 << 20;

pub enum Argument<'a> {
    Number(f64),
    Scan(Scan<'a>),
}

pub struct Scan<'a> {
    pub values: Map<String, Value>,
    pub arrays: Vec<(&'static str, Array<'a>)>,
}

/// An array that is sent as it lies in memory.
pub enum Array<'a> {
    Bytes(ArrayViewD<'a, u8>),
    Floats(ArrayViewD<'a, f32>),
}

#[derive(Debug)]
pub enum Returned {
    Values(Vec<f64>),
    /// Factors, and the array of the scan whose shape they have.
    Factors(Array2<f32>, String),
}

#[derive(Debug)]
pub struct Function {
    file: PathBuf,
    python: Child,
    requests: BufWriter<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Function {
    /// Starts the interpreter that `GYRE_PYTHON` names, or `python3`, and loads the function of
    /// this name in the file. Another attempt helps where a process was killed or not to be had.
    pub fn load(file: &Path, name: &str) -> Result<Self, RunError> {
        let absolute = std::path::absolute(file).ok().filter(|file| file.is_file());
        let file = absolute
            .ok_or_else(|| RunError::Input(format!("there is no file {}", file.display())))?;
        let python = interpreter();
        let of = file.display();
        let start = |error: std::io::Error| {
            let sentence = format!(
                "cannot start {python} for {of}: {error}; install Python 3, or name one with GYRE_PYTHON"
            );
            match error.kind() {
                ErrorKind::NotFound | ErrorKind::PermissionDenied => RunError::Input(sentence),
                _ => RunError::Transient(sentence),
            }
        };
        let mut command = Command::new(&python);
        command.args(["-u", "-c", PROGRAM]).arg(&file).arg(name);
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
            file: file.clone(),
            python: child,
            requests: BufWriter::new(requests),
            answers: BufReader::with_capacity(PIPE_BYTES, answers),
        };
        match function.answer() {
            Ok(_) => Ok(function),
            Err(exception @ RunError::Input(_)) => Err(exception),
            Err(ended) => Err(match function.python.try_wait() {
                Ok(Some(status)) if status.code().is_some() => RunError::Input(format!(
                    "{python} has ended before it had loaded {of}: {status}; name a Python of version 3 with \
                     GYRE_PYTHON, and see that the file does not end it"
                )),
                _ => ended,
            }),
        }
    }

    /// Calls the function. An exception is [`RunError::Input`].
    pub fn call(&mut self, arguments: &[Argument<'_>]) -> Result<Returned, RunError> {
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
                match array {
                    Array::Bytes(array) => rows(array, &mut self.requests)?,
                    Array::Floats(array) => rows(array, &mut self.requests)?,
                }
            }
        }
        self.requests.flush()
    }

    fn array<T: bytemuck::Pod>(&mut self, shape: (usize, usize)) -> Option<Array2<T>> {
        let mut array = Array2::from_elem(shape, T::zeroed());
        let cells = array.as_slice_mut()?;
        self.answers
            .read_exact(bytemuck::cast_slice_mut(cells))
            .ok()?;
        Some(array)
    }

    /// Reads a line. An exception is [`RunError::Input`]: the file, its line, and Python's
    /// message. The traceback is on standard error.
    fn answer(&mut self) -> Result<Value, RunError> {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line);
        let header = read.ok().and_then(|_| serde_json::from_str(&line).ok());
        let header: Value = header.ok_or_else(|| self.ended())?;
        match header["error"].as_str() {
            Some(sentence) => Err(RunError::Input(sentence.to_owned())),
            None => Ok(header),
        }
    }

    /// The interpreter was killed while it loaded the file, or has ended in the middle of a call.
    fn ended(&mut self) -> RunError {
        let status = self.python.wait().map(|status| status.to_string());
        RunError::Transient(format!(
            "Python has ended while it worked for {}: {}",
            self.file.display(),
            status.unwrap_or_else(|error| error.to_string())
        ))
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

/// Writes the values row by row, without what lies between rows.
fn rows<T: bytemuck::Pod>(array: &ArrayViewD<'_, T>, out: &mut impl Write) -> std::io::Result<()> {
    for row in array.rows() {
        match row.to_slice() {
            Some(row) => out.write_all(bytemuck::cast_slice(row))?,
            None => out.write_all(bytemuck::cast_slice(&row.to_vec()))?,
        }
    }
    Ok(())
}

const VARIABLE: &str = "GYRE_PYTHON";
const OLDEST: [u32; 2] = [3, 8];
const PROBE: &str = "
import json, sys
try:
    import numpy
    version = numpy.__version__
except ImportError:
    version = None
print(json.dumps({'executable': sys.executable, 'version': list(sys.version_info[:3]), 'numpy': version}))
";

#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Interpreter {
    pub executable: String,
    pub version: [u32; 3],
    /// The version of numpy; `None`: it cannot be imported.
    pub numpy: Option<String>,
}

fn interpreter() -> String {
    env::var(VARIABLE).unwrap_or_else(|_| "python3".to_owned())
}

impl Interpreter {
    pub fn find() -> Result<Self, String> {
        let python = interpreter();
        let mut command = Command::new(&python);
        command.args(["-c", PROBE]).stdin(Stdio::null());
        let output = command.output().map_err(|error| {
            format!(
                "cannot start {python}: {error}; install Python 3, or name one with GYRE_PYTHON"
            )
        })?;
        let found: Option<Self> = serde_json::from_slice(&output.stdout).ok();
        let [major, minor] = OLDEST;
        found
            .filter(|found| found.version[..2] >= OLDEST[..])
            .ok_or_else(|| {
                format!("{python} is no Python of version {major}.{minor} or newer: name one with GYRE_PYTHON")
            })
    }
}
