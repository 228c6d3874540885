//! Printing to the terminal; a closed pipe is not an error.

use std::{fmt::Display, io::Write};

use crate::Failure;

/// Prints a line to standard output. A closed pipe (`gyre inspect ... | head`) is not an error.
///
/// # Errors
/// Any other failure to write.
pub fn line(text: impl Display) -> Result<(), Failure> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Prints a line to standard error. Failures are ignored: a run does not end because its terminal is closed.
pub fn note(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}
