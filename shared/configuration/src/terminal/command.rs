//! Programs and times as they are given on a command line.

use std::{
    ffi::OsString,
    io,
    os::unix::process::CommandExt,
    path::PathBuf,
    process::{self, Command},
    time::Duration,
};

use crate::terminal::Failure;

/// Returns a path of the program that this process executes, for its children too.
pub fn own() -> PathBuf {
    PathBuf::from(format!("/proc/{}/exe", process::id()))
}

/// Executes this program again, with its name and these arguments and a variable in its
/// environment. Returns why that has failed.
pub fn execute_again(
    arguments: impl Iterator<Item = OsString>,
    variable: &str,
    value: &str,
) -> io::Error {
    let mut command = Command::new(own());
    command.args(arguments.skip(1)).env(variable, value).exec()
}

/// Returns the program and the arguments of a `--command`, as a shell would part them.
pub fn words(command: &str) -> Result<Vec<String>, Failure> {
    match shlex::split(command) {
        Some(words) if !words.is_empty() => Ok(words),
        _ => Err(format!("--command is `{command}`, but must be a program and its arguments, with its quotes closed").into()),
    }
}

/// Parses a duration of the command line, s.
pub fn seconds(text: &str) -> Result<Duration, &'static str> {
    let seconds = text.parse().unwrap_or(f64::NAN);
    Duration::try_from_secs_f64(seconds).map_err(|_| "it must be a number, 0 or more")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_that_is_no_duration_is_refused() {
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        for text in ["nan", "inf", "-1", "1e30", "soon", ""] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }
}
