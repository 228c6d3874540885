//! A program from its arguments to its exit code.

use std::process::ExitCode;

use clap::Parser;

use crate::terminal::{Failure, WIDTH, print};

const WRONG_ARGUMENTS: u8 = 2;

/// The exit code of an interrupted program, as shells have it.
pub const INTERRUPTED: u8 = 130;

/// Parses the command line. Help is printed to standard output, a wrong argument to standard error,
/// and the exit code is returned.
pub fn parse<P: Parser>(program: &str) -> Result<P, ExitCode> {
    parse_as(P::command(), program)
}

pub fn parse_as<P: Parser>(command: clap::Command, program: &str) -> Result<P, ExitCode> {
    let matches = command.max_term_width(WIDTH).try_get_matches();
    let parsed = matches.and_then(|matches| P::from_arg_matches(&matches));
    parsed.map_err(|error| match (error.use_stderr(), error.print()) {
        (true, _) => ExitCode::from(WRONG_ARGUMENTS),
        (false, written) => report(program, print::printed(written).map(|()| ExitCode::SUCCESS)),
    })
}

pub fn report(program: &str, result: Result<ExitCode, Failure>) -> ExitCode {
    result.unwrap_or_else(|error| {
        print::note(format_args!("{program}: {error}"));
        ExitCode::FAILURE
    })
}
