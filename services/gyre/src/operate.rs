//! The commands that operate running runs: `gyre up`, `down`, `ps`, `logs`, `top`, `restart` and
//! `swap`.
//!
//! Each asks the supervisor of a run at its control socket ([`gyre_stage::control`]); nothing of a
//! run is looked up elsewhere, but its logs.

mod background;
mod events;
mod logs;
mod processes;
mod top;

use std::{env, process::ExitCode};

use gyre_stage::control::{Control, Swap};
use gyre_supervise::Program;

use crate::{
    Failure,
    cli::{RestartArguments, RunChoice, SwapArguments},
    print, program,
};

pub use background::{detach_if_asked, down, up};
pub use logs::logs;
pub use processes::ps;
pub use top::top;

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
    let command = arguments.command.as_deref().map(program::words);
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

/// Returns the run that is meant: the one that is named, or the only one.
pub(crate) fn chosen(choice: &RunChoice) -> Result<Control, Failure> {
    if let Some(out) = &choice.out {
        return Ok(Control::of(out)?);
    }
    let mut runs = Control::of_all();
    match (runs.pop(), runs.is_empty()) {
        (None, _) => Err("no run is running: `gyre up` or `gyre run` starts one".into()),
        (Some(run), true) => Ok(run),
        (Some(last), false) => {
            let names = runs.iter().chain([&last]).map(|run| run.out().display());
            let names: Vec<String> = names.map(|name| name.to_string()).collect();
            let names = names.join(", ");
            Err(format!("several runs are running: choose one with --out, of {names}").into())
        }
    }
}
