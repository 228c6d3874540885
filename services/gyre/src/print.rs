//! Printing to whoever reads, as long as they do.

use std::{fmt::Display, io::Write};

use crate::Failure;

/// Prints a line. A reader that has seen enough (`gyre inspect ... | head`) is no error.
pub fn line(text: impl Display) -> Result<(), Failure> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Tells the person at the terminal something on the way. A run does not end because nobody listens any more.
pub fn note(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}
