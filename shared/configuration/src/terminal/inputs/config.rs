//! `gyre config`: the configurations in the program.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;

use crate::{
    paths,
    terminal::{Failure, WIDTH, print, wrap},
};

const NAMES: usize = 18;

/// The arguments of `gyre config`.
#[derive(Debug, Args)]
pub struct ConfigArguments {
    /// The name of a configuration, as oxford. Default: list all.
    pub name: Option<PathBuf>,
}

/// Lists the configurations in the program, or prints one as it is.
pub fn config(arguments: &ConfigArguments) -> Result<ExitCode, Failure> {
    match &arguments.name {
        Some(name) => {
            let text = gyre_storage::shipped::configuration(name)
                .and_then(|path| gyre_storage::shipped::text(&path));
            print::line(text.ok_or_else(|| paths::unknown(name))?.trim_end())?;
        }
        None => {
            gyre_storage::shipped::configurations().try_for_each(|it| print::line(entry(it)))?
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn entry((name, purpose): (&str, String)) -> String {
    let indent = format!("\n{:NAMES$}", "");
    let lines = wrap(&purpose, WIDTH - NAMES).join(&indent);
    format!("{name:NAMES$}{lines}")
}
