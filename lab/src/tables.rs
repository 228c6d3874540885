//! `gyre-lab tables`: Fast-MbyM's Table III for this machine, the paper's figures and a peer's beside ours.
//!
//! - [`rows`]: what is compared, and what each row changes in a configuration;
//! - [`papers`]: the paper's figures; [`models`]: the networks;
//! - [`times`] (Table IIIa) and [`peer`]; [`accuracy`] (Table IIIb): the measurements;
//! - [`variations`]: what single changes do to the shipped configuration;
//! - [`ladder`]: the steps from the paper's form to it;
//! - [`markdown`]: the tables as text.

pub(crate) mod accuracy;
mod ladder;
mod markdown;
mod models;
mod papers;
mod peer;
pub(crate) mod rows;
mod times;
mod variations;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use gyre_radar::OwnedScan;
use serde::Serialize;

use crate::cli::TablesArguments;
use accuracy::Accuracies;
use gyre::{
    Failure,
    configuration::Configuration,
    machine::{Machine, today},
    print,
};
use ladder::Ladder;
use models::Models;
use peer::Peer;
use times::Times;
use variations::Variations;

/// All of it: `tables.json`.
#[derive(Debug, Serialize)]
struct Tables {
    version: &'static str,
    /// Known where the builder set `GYRE_COMMIT`.
    commit: Option<&'static str>,
    machine: Machine,
    /// UTC.
    date: String,
    command: String,
    /// Table IIIa, unless `--no-table-iii` leaves it out.
    times: Option<Times>,
    /// Table IIIb, sequence by sequence.
    accuracy: Vec<Accuracies>,
    /// What `--vary` asked for, sequence by sequence.
    variations: Vec<Variations>,
    /// What `--ladder` asked for, sequence by sequence.
    ladders: Vec<Ladder>,
    /// Where the paper's figures are from.
    papers: &'static str,
}

/// Measures, prints and writes both tables.
pub fn tables(arguments: &TablesArguments) -> Result<ExitCode, Failure> {
    let sequences = sequences(arguments)?;
    let changes = variations::changes(&arguments.vary)?;
    let where_asked = |asked: bool| if asked { sequences.as_slice() } else { &[] };
    let table_iii = !arguments.no_table_iii;
    for change in &changes {
        sequences[0].configuration(std::slice::from_ref(change))?;
    }
    let out = &arguments.out;
    fs::create_dir_all(out)
        .map_err(|error| format!("cannot write to {}: {error}", out.display()))?;
    let models = Models::new(&arguments.models);
    let peer = Peer::new(arguments.peer.as_deref(), arguments.peer_script.as_deref());
    let tables = Tables {
        version: env!("CARGO_PKG_VERSION"),
        commit: option_env!("GYRE_COMMIT"),
        machine: Machine::this(),
        date: today(),
        command: command(
            env::args_os()
                .skip(1)
                .map(|argument| argument.to_string_lossy().into_owned()),
        ),
        times: where_asked(table_iii)
            .first()
            .map(|first| {
                times::measure(
                    first,
                    &arguments.sizes,
                    arguments.passes.get(),
                    &models,
                    peer.as_ref(),
                    out,
                )
            })
            .transpose()?,
        accuracy: where_asked(table_iii)
            .iter()
            .map(|sequence| accuracy::measure(sequence, &models, &out.join(&sequence.name)))
            .collect::<Result<_, _>>()?,
        variations: where_asked(!changes.is_empty())
            .iter()
            .map(|sequence| variations::measure(sequence, &changes, &out.join(&sequence.name)))
            .collect::<Result<_, _>>()?,
        ladders: where_asked(arguments.ladder)
            .iter()
            .map(|sequence| ladder::measure(sequence, &models, &out.join(&sequence.name)))
            .collect::<Result<_, _>>()?,
        papers: papers::SOURCE,
    };
    let text = markdown::of(&tables);
    save(
        &out.join("tables.json"),
        &serde_json::to_string_pretty(&tables)?,
    )?;
    save(&out.join("tables.md"), &text)?;
    print::line(text.trim_end())?;
    Ok(ExitCode::SUCCESS)
}

/// A sequence that was named on the command line.
#[derive(Debug)]
pub(crate) struct Sequence {
    /// The configuration's and the folder's names: the results' folder.
    name: String,
    file: PathBuf,
    data: PathBuf,
}

/// The sequences in the order of the command line, each with a folder of its own for its results.
fn sequences(arguments: &TablesArguments) -> Result<Vec<Sequence>, Failure> {
    let (files, data) = (&arguments.configurations, &arguments.data);
    if files.len() != data.len() {
        return Err(format!(
            "{} --config but {} --data: give one for one",
            files.len(),
            data.len()
        )
        .into());
    }
    let mut sequences: Vec<Sequence> = Vec::new();
    for (file, data) in files.iter().zip(data) {
        let sequence = Sequence::new(file, data);
        if let Some(other) = sequences.iter().find(|other| other.name == sequence.name) {
            let (one, two) = (other.data.display(), data.display());
            return Err(format!(
                "{one} and {two} would write to the same folder, {}",
                sequence.name
            )
            .into());
        }
        sequence.configuration(&[])?;
        sequences.push(sequence);
    }
    Ok(sequences)
}

impl Sequence {
    pub(crate) fn new(file: &Path, data: &Path) -> Self {
        // `recordings/.` and the like have names only once they are resolved.
        let resolved = data.canonicalize().unwrap_or_else(|_| data.to_owned());
        let folder = resolved.file_name().unwrap_or_default().to_string_lossy();
        let name = format!(
            "{}-{folder}",
            file.file_stem().unwrap_or_default().to_string_lossy()
        );
        Self {
            name,
            file: file.to_owned(),
            data: data.to_owned(),
        }
    }

    /// Its configuration with a row's changes.
    pub(crate) fn configuration(&self, changes: &[String]) -> Result<Configuration, Failure> {
        Ok(Configuration::read(&self.file, changes)?)
    }

    /// The arguments of the `gyre run` with a row's changes.
    fn run_arguments(&self, changes: &[String], out: &Path) -> Vec<String> {
        let mut arguments = vec!["run".to_owned(), self.file.display().to_string()];
        for (option, path) in [("--data", self.data.as_path()), ("--out", out)] {
            arguments.extend([option.to_owned(), path.display().to_string()]);
        }
        arguments.extend(["--rate", "max", "--fresh"].map(str::to_owned));
        arguments.extend(
            changes
                .iter()
                .flat_map(|change| ["--set".to_owned(), change.clone()]),
        );
        arguments
    }

    /// Its first scans, at most `most`, those that cannot be read left out; at least two.
    fn scans(&self, most: usize) -> Result<Vec<OwnedScan>, Failure> {
        let configuration = self.configuration(&[])?;
        let mut dataset = gyre_radar::open(&self.data, &configuration.dataset)?;
        let len = dataset.len();
        let read = |index| {
            let mut scan = OwnedScan::with_limits(dataset.limits());
            scan.geometry = dataset.read(index, scan.slot()).ok()?;
            Some(scan)
        };
        let scans: Vec<OwnedScan> = (configuration.source.first..len)
            .filter_map(read)
            .take(most)
            .collect();
        match scans.len() {
            0 | 1 => {
                Err(format!("{} has no two scans that can be read", self.data.display()).into())
            }
            _ => Ok(scans),
        }
    }
}

/// The command line that calls gyre with these arguments.
fn command(arguments: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let quoted = |argument: &str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
        match !argument.is_empty() && argument.chars().all(plain) {
            true => argument.to_owned(),
            false => format!("'{}'", argument.replace('\'', r"'\''")),
        }
    };
    let words = arguments
        .into_iter()
        .map(|argument| quoted(argument.as_ref()));
    std::iter::once("gyre".to_owned())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

fn save(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text)
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_can_be_given_to_a_shell() {
        assert_eq!(
            command(["run", "a b.toml", "--set", "x=1", "it's"]),
            r"gyre run 'a b.toml' --set x=1 'it'\''s'"
        );
        assert_eq!(command([""; 1]), "gyre ''");
    }

    #[test]
    fn a_run_repeats_the_row_from_the_command_line() {
        let sequence = Sequence::new(
            Path::new("configs/oxford.toml"),
            Path::new("recordings/monday"),
        );
        assert_eq!(sequence.name, "oxford-monday");
        let arguments =
            sequence.run_arguments(&["search.kind=exhaustive".to_owned()], Path::new("out/raw"));
        let expected = "gyre run configs/oxford.toml --data recordings/monday --out out/raw --rate max --fresh \
                        --set search.kind=exhaustive";
        assert_eq!(command(arguments), expected);
    }
}
