//! `gyre restart` and `gyre swap`: other processes in the places of those of a running run.

use std::{env, process::ExitCode};

use gyre_stage::control::Swap;
use gyre_supervise::Program;
use gyre_terminal::{Failure, print, words};

use crate::{
    arguments::{RestartArguments, SwapArguments},
    choice::chosen,
};

/// Starts a process of a running run again.
///
/// # Errors
/// There is no such run or process, or the supervisor does not answer.
pub fn restart(arguments: &RestartArguments) -> Result<ExitCode, Failure> {
    let run = chosen(&arguments.run)?;
    run.restart(&arguments.process)?;
    print::line(format_args!("{} is started again", arguments.process))?;
    Ok(ExitCode::SUCCESS)
}

/// The exit code of a swap to a program that nothing is known against, and nothing for.
const UNTRIED: u8 = 2;

/// Goes on with another program in the place of a stage.
///
/// # Errors
/// There is no such run or process, or the program does not come to take over, or fails at its
/// first scan: the one before goes on.
pub fn swap(arguments: &SwapArguments) -> Result<ExitCode, Failure> {
    let run = chosen(&arguments.run)?;
    let command = arguments.command.as_deref().map(words);
    let command = command.transpose()?;
    // Found as in this terminal: the supervisor may have been started with another PATH.
    let command = command.map(|mut command: Vec<String>| {
        if let Some(program) = command.first_mut() {
            *program = Program::place_of(program).display().to_string();
        }
        command
    });
    let what = match &command {
        Some(command) => format!("`{}`", command.join(" ")),
        None => "the program that the run was begun with".to_owned(),
    };
    let directory = env::current_dir()
        .map_err(|error| format!("cannot tell the current directory: {error}"))?;
    let swap = Swap {
        process: arguments.process.clone(),
        command,
        directory,
        cold: arguments.cold,
    };
    if let Some(untried) = run.swap(swap)? {
        print::note(format_args!("gyre: {untried}"));
        return Ok(ExitCode::from(UNTRIED));
    }
    print::line(format_args!("{} is {what} now", arguments.process))?;
    Ok(ExitCode::SUCCESS)
}
