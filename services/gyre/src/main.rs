//! `gyre`: radar odometry as cooperating processes, on the command line.
//!
//! Reading order: [`cli`], then [`run`] (what `gyre run` does, in a page), [`configuration`], [`results`].

mod cli;
mod configuration;
mod evaluate;
mod export_pairs;
mod inspect;
mod judgement;
mod latency;
mod machine;
mod masks;
mod odometry;
mod preflight;
mod print;
mod progress;
mod realism;
mod results;
mod run;
mod search;
mod simulate;
mod spoil;
mod stage;
mod summary;
mod tables;

use std::process::ExitCode;

use clap::Parser;

use cli::{Command, Gyre};

/// A sentence for the person at the terminal.
type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> ExitCode {
    let result = match Gyre::parse().command {
        Command::Stage { name } => return stage::run(&name),
        Command::Run(arguments) => run::run(&arguments),
        Command::Inspect(arguments) => inspect::inspect(&arguments),
        Command::Evaluate(arguments) => evaluate::evaluate(&arguments),
        Command::Masks(arguments) => masks::masks(&arguments),
        Command::Tables(arguments) => tables::tables(&arguments),
        Command::Realism(arguments) => realism::realism(&arguments),
        Command::Simulate(arguments) => simulate::simulate(&arguments),
        Command::ExportPairs(arguments) => export_pairs::export_pairs(&arguments),
        Command::Spoil(arguments) => spoil::spoil(&arguments),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            print::note(format_args!("gyre: {error}"));
            ExitCode::FAILURE
        }
    }
}
