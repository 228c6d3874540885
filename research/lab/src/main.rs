//! `gyre-lab`: tables of the papers, ablations, corrupted recordings, training pairs.

mod ablation;
mod cli;
mod corrupt;
mod drive;
mod export_pairs;
mod gnss;
mod localisation;
mod models;
mod places;
mod recording;
mod report;
mod sequence;
mod slam;
mod tables;

use std::process::ExitCode;

use cli::{Command, Lab};

fn main() -> ExitCode {
    let command = match gyre_configuration::terminal::parse::<Lab>("gyre-lab") {
        Ok(lab) => lab.command,
        Err(code) => return code,
    };
    let result = match command {
        Command::Tables(arguments) => tables::tables(&arguments),
        Command::Ablation(arguments) => ablation::ablation(&arguments),
        Command::Corrupt(arguments) => corrupt::corrupt(&arguments),
        Command::ExportPairs(arguments) => export_pairs::export_pairs(&arguments),
        Command::Places(arguments) => places::places(&arguments),
        Command::Slam(arguments) => slam::slam(&arguments),
        Command::Gnss(arguments) => gnss::gnss(&arguments),
        Command::Localisation(arguments) => localisation::localisation(&arguments),
    };
    gyre_configuration::terminal::report("gyre-lab", result)
}
