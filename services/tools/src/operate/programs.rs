//! `gyre restart` and `gyre swap`: replace processes of a running run.

use std::{env, process::ExitCode};

use gyre_run::StageConfig;
use gyre_stage::control::{PendingSwap, Swap};
use gyre_supervise::Program;
use gyre_terminal::{Failure, print, words};

use crate::operate::{
    arguments::{RestartArguments, SwapArguments},
    choice::chosen_to_change,
};

/// Starts a process of a running run again.
pub fn restart(arguments: &RestartArguments) -> Result<ExitCode, Failure> {
    let what = format!("restart its {}", arguments.process);
    let run = chosen_to_change(&arguments.run, &what)?;
    run.restart(&arguments.process)?;
    print::line(format_args!("{} is started again", arguments.process))?;
    Ok(ExitCode::SUCCESS)
}

/// Time after which the reason for waiting is printed.
const EXPLAIN_AFTER_S: f64 = 5.0;

/// The printed progress of a swap.
#[derive(Default)]
struct Waiting {
    /// True if the program had taken over then.
    told: Option<bool>,
}

impl Waiting {
    /// Prints the reason for waiting once for each step of a swap.
    fn explain(&mut self, pending: &PendingSwap) {
        if pending.waited_s > EXPLAIN_AFTER_S && self.told != Some(pending.has_taken_over) {
            self.told = Some(pending.has_taken_over);
            print::note(format_args!("gyre: {}", sentence(pending)));
        }
    }
}

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
            "{process} goes on as before: waiting {limit} (run.start_timeout_s) for `{command}` to say that it is ready to take over; \
             interrupt this to give it up, and start a program that cannot stand by with --cold"
        ),
    }
}

/// The exit code of a swap to a program that nothing is known against, and nothing for.
const UNTRIED: u8 = 2;

/// Replaces the program of a stage. If the new program fails to take over, the previous program
/// continues.
pub fn swap(arguments: &SwapArguments) -> Result<ExitCode, Failure> {
    let what = format!("swap its {}", arguments.process);
    let run = chosen_to_change(&arguments.run, &what)?;
    let command = arguments.command.as_deref().map(words);
    let command = command.transpose()?;
    // Found as in this terminal: the supervisor may have been started with another PATH.
    let command = command.map(|mut command: Vec<String>| {
        if let Some(program) = command.first_mut() {
            *program = Program::place_of(program).display().to_string();
        }
        command
    });
    let command = match &arguments.python {
        None => command,
        Some(file) => {
            // By its own name: this process ends before the stage does.
            let gyre = env::current_exe()
                .map_err(|error| format!("cannot tell the program of this process: {error}"))?;
            let (gyre, process) = (gyre.to_string_lossy(), &arguments.process);
            Some(StageConfig::own_command(&gyre, process, Some(file)))
        }
    };
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
    let mut waiting = Waiting::default();
    if let Some(untried) = run.swap(swap, &mut |pending| waiting.explain(pending))? {
        print::note(format_args!("gyre: {untried}"));
        return Ok(ExitCode::from(UNTRIED));
    }
    print::line(format_args!("{} is {what} now", arguments.process))?;
    Ok(ExitCode::SUCCESS)
}
