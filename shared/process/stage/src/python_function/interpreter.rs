//! The interpreter that functions are called in.

use std::{
    env,
    process::{Command, Stdio},
};

use serde::Deserialize;

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

pub(crate) fn name() -> String {
    env::var(VARIABLE).unwrap_or_else(|_| "python3".to_owned())
}

impl Interpreter {
    pub fn find() -> Result<Self, String> {
        let python = name();
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
