//! Printing to the terminal; a closed pipe is not an error.

use std::{
    fmt::Display,
    io::{self, IsTerminal, Write},
};

use crate::terminal::{
    Failure,
    wrap::{WIDTH, wrap, wrap_values},
};

/// Prints a line to standard output. A closed pipe (`gyre inspect ... | head`) is not an error.
pub fn line(text: impl Display) -> Result<(), Failure> {
    printed(writeln!(io::stdout(), "{text}"))
}

/// Prints lines of names and values, on a terminal so that they fit it.
pub fn values(text: impl Display) -> Result<(), Failure> {
    match io::stdout().is_terminal() {
        true => line(wrap_values(&text.to_string(), WIDTH).join("\n")),
        false => line(text),
    }
}

pub fn printed(written: io::Result<()>) -> Result<(), Failure> {
    match written {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}").into())
        }
        _ => Ok(()),
    }
}

/// Prints a line to standard error, on a terminal as several that fit it. Failures are ignored: a
/// run does not end because its terminal is closed.
pub fn note(text: impl Display) {
    let mut text = printable(&text.to_string());
    if io::stderr().is_terminal() {
        text = wrap(&text, WIDTH).join("\n");
    }
    let _ = writeln!(io::stderr(), "{text}");
}

/// Names and words of files are quoted unchanged but for what a terminal would execute.
fn printable(text: &str) -> String {
    let plain = |c: char| {
        if c.is_control() && c != '\n' {
            char::REPLACEMENT_CHARACTER
        } else {
            c
        }
    };
    text.chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_quoted_commands_the_terminal() {
        let text = printable("cannot read \u{1b}[2J\t\u{7}é:\nno");
        assert_eq!(text, "cannot read \u{fffd}[2J\u{fffd}\u{fffd}é:\nno");
    }
}
