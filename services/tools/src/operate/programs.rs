//! `gyre restart` and `gyre swap`: replace processes of a running run.

use std::{env, path::PathBuf, process::ExitCode};

use clap::Args;
use gyre_client::control::place_of_program;
use gyre_configuration::terminal::{Failure, print, words};
use gyre_contract::{
    control::{PendingSwap, Swap},
    run::StageConfig,
};

use crate::operate::{RunChoice, chosen_to_change};

#[derive(Debug, Args)]
pub struct RestartArguments {
    /// The process, as masking.
    pub process: String,
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
}

#[derive(Debug, Args)]
pub struct SwapArguments {
    /// The process whose place is taken, as masking.
    pub process: String,
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// The program that takes over and its arguments, as in 'python3 stage.py --fast'; no shell is
    /// involved. Default: the one that the run was begun with.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    /// End the program before first. For a program that cannot stand by; scans wait for it
    /// meanwhile, or are dropped in live mode.
    #[arg(long)]
    pub cold: bool,
}

pub fn restart(arguments: &RestartArguments) -> Result<(), Failure> {
    let run = chosen_to_change(&arguments.run)?;
    run.restart(&arguments.process)?;
    print::line(format_args!("{} is started again", arguments.process))
}

const EXPLAIN_AFTER_S: f64 = 5.0;

/// Explains the wait of a swap, its duration, and the remedy.
fn sentence(pending: &PendingSwap) -> String {
    let (process, command) = (&pending.process, pending.command.join(" "));
    let limit = match pending.limit_s {
        Some(limit_s) => format!("for {limit_s} s at most"),
        None => "without a limit".to_owned(),
    };
    match pending.has_taken_over {
        true => format!(
            "`{command}` has taken over from {process}: waiting {limit} for a first scan to go through it"
        ),
        false => format!(
            "{process} continues as before: waiting {limit} (run.start_timeout_s) for `{command}` to report that it is ready to take over; \
             interrupt this to give it up, and start a program that cannot stand by with --cold"
        ),
    }
}

/// The exit code of a swap to a program that nothing is known against, and nothing for.
const UNTRIED: u8 = 2;

/// Replaces the program of a stage. If the new program fails to take over, the previous program
/// continues.
pub fn swap(arguments: &SwapArguments) -> Result<ExitCode, Failure> {
    let run = chosen_to_change(&arguments.run)?;
    let process = &arguments.process;
    let mut command = arguments.command.as_deref().map(words).transpose()?;
    // Found as in this terminal: the supervisor may have been started with another PATH.
    if let Some(program) = command.as_mut().and_then(|command| command.first_mut()) {
        *program = place_of_program(program).display().to_string();
    }
    if let Some(file) = &arguments.python {
        // By its own name: this process ends before the stage does.
        let gyre = env::current_exe()
            .map_err(|error| format!("cannot find the program of this process: {error}"))?;
        let gyre = gyre.to_string_lossy();
        command = Some(StageConfig::own_command(&gyre, process, Some(file)));
    }
    let what = match &command {
        Some(command) => format!("`{}`", command.join(" ")),
        None => "the program that the run was begun with".to_owned(),
    };
    let directory = env::current_dir()
        .map_err(|error| format!("cannot find the current directory: {error}"))?;
    let swap = Swap {
        process: process.clone(),
        command,
        directory,
        cold: arguments.cold,
    };
    // Explains the wait once for each step of the swap.
    let mut explained = None;
    let mut explain = |pending: &PendingSwap| {
        let step = Some(pending.has_taken_over);
        if pending.waited_s > EXPLAIN_AFTER_S && explained != step {
            explained = step;
            print::note(format_args!("gyre: {}", sentence(pending)));
        }
    };
    if let Some(untried) = run.swap(swap, &mut explain)? {
        print::note(format_args!("gyre: {untried}"));
        return Ok(ExitCode::from(UNTRIED));
    }
    print::line(format_args!("{process} is {what} now"))?;
    Ok(ExitCode::SUCCESS)
}
