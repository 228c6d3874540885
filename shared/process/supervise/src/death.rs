//! The death of a process.

use std::fmt;

#[derive(Clone, Debug)]
pub struct Death {
    pub killed: bool,
    /// The cause, as `signal 9` or `exit code 3`.
    pub cause: String,
    pub code: Option<i32>,
    pub last_output: Option<String>,
}

impl Death {
    pub(crate) fn output(&self) -> String {
        let line = self.last_output.as_ref();
        line.map_or_else(String::new, |line| format!(" ({line})"))
    }
}

/// The end of a sentence, as `it ended with exit code 3, its last line: ...`.
impl fmt::Display for Death {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it ended with {}", self.cause)?;
        match &self.last_output {
            Some(line) => write!(f, ", its last line: {line}"),
            None => Ok(()),
        }
    }
}
