//! The commands that operate running runs: `gyre up`, `down`, `ps`, `logs`, `top`, `restart`,
//! `swap`, `reset`, `new-map`, `locate` and `echo`.
//!
//! Each asks the supervisor of a run at its control socket ([`gyre_client::control`]); nothing of a
//! run is looked up elsewhere, but its logs.

mod background;
mod commands;
mod echo;
mod hz;
mod logs;
mod processes;
mod programs;
mod top;

use std::{env, path::PathBuf};

use clap::Args;
use gyre_client::control::Control;
use gyre_configuration::terminal::{Failure, print};

pub(crate) use background::status_of;
pub use background::{detach_if_asked, down, is_in_background, up};
pub use commands::{LocateArguments, ResetArguments, locate, new_map, reset};
pub use echo::{EchoArguments, echo};
pub use logs::{LogsArguments, logs};
pub use processes::{PsArguments, ps};
pub use programs::{RestartArguments, SwapArguments, restart, swap};
pub use top::{TopArguments, top};

/// The run that a command is about.
#[derive(Debug, Args)]
pub struct RunChoice {
    /// The run: the folder of its results. Default: the only run there is; a command that changes a
    /// run takes only one that was started from the current folder.
    #[arg(value_name = "RUN")]
    pub run: Option<PathBuf>,
}

impl RunChoice {
    pub fn folder(&self) -> Result<PathBuf, Failure> {
        match &self.run {
            Some(run) => Ok(run.clone()),
            None => Ok(chosen(self)?.out().to_owned()),
        }
    }
}

/// Returns the run that is meant: the one that is named, or the only one, which is named here.
pub fn chosen(choice: &RunChoice) -> Result<Control, Failure> {
    if let Some(out) = &choice.run {
        return Ok(Control::of(out)?);
    }
    let run = Control::only()?;
    name(&run);
    Ok(run)
}

/// Returns the run that is meant by a command that changes it. Without a name that is one which was
/// started from the current folder.
pub fn chosen_to_change(choice: &RunChoice) -> Result<Control, Failure> {
    if let Some(out) = &choice.run {
        return Ok(Control::of(out)?);
    }
    let run = Control::only()?;
    let started_in = run.status()?.started_in;
    if env::current_dir().is_ok_and(|here| here == started_in) {
        name(&run);
        return Ok(run);
    }
    let (out, started_in) = (run.out().display(), started_in.display());
    Err(format!(
        "the only run writes to {out} and was started from {started_in}, not from here: if it is meant, name it: {out}"
    )
    .into())
}

fn name(run: &Control) {
    print::note(format_args!("gyre: of the run in {}", run.out().display()));
}
