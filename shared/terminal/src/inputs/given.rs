//! The arguments and the inputs that they name.

use std::path::{Path, PathBuf};

use crate::{Failure, print};
use clap::Args;
use gyre_configuration::Configuration;
use thiserror::Error;

use crate::inputs::kind::Kind;

/// The words and options that name the inputs of a command.
#[derive(Clone, Debug, Default, Args)]
pub struct Inputs {
    /// The recording (a folder, NAME.mcap, a bag of ROS 2), the configuration (a TOML file, or a
    /// name that `gyre config` lists) or the address of a radar, in any order.
    #[arg(value_name = "WHAT")]
    pub what: Vec<PathBuf>,
    /// The configuration. Default: settings from the recording's format and its scans.
    #[arg(long, value_name = "FILE|NAME")]
    pub config: Option<PathBuf>,
    /// The recording (source.data). Default: the recording of the configuration.
    #[arg(long, value_name = "PATH")]
    pub data: Option<PathBuf>,
    /// Override a key of the configuration, as in masking.kind=none; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

/// The things that the arguments of a command name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Given {
    /// The configuration: a file, or the name of one in the program.
    pub configuration: Option<PathBuf>,
    pub data: Option<PathBuf>,
    /// The address of a radar.
    pub radar: Option<String>,
}

/// Why the arguments of a command are refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum InputError {
    #[error("`{0}` and `{1}` are both {2}: name one")]
    Twice(String, String, &'static str),
    #[error("`{0}` is a recording and `{1}` the address of a radar: name one")]
    Both(String, String),
    #[error(
        "{0} has the results of a run: name {0}/config.toml to compute them again, or export a recording of it (`gyre export`)"
    )]
    Results(String),
    #[error(
        "`{0}` is a folder here and the name of a configuration: write ./{0} for the folder, --config {0} for the configuration"
    )]
    Ambiguous(String),
    #[error(
        "`{0}` is no file or folder, no name that `gyre config` lists, and not the address of a radar{1}"
    )]
    Unknown(String, String),
    #[error(
        "`{0}` is the address of a radar, and only `gyre run` and `gyre up` receive one: name a recording"
    )]
    Radar(String),
}

impl Inputs {
    pub fn given(&self) -> Result<Given, InputError> {
        let mut given = Given {
            configuration: self.config.clone(),
            data: self.data.clone(),
            radar: None,
        };
        // A folder whose name is also a configuration's is the one that is still missing.
        let kinds = self.what.iter().map(|word| (word, Kind::of(word)));
        let (unclear, clear): (Vec<_>, Vec<_>) =
            kinds.partition(|(_, kind)| *kind == Kind::Ambiguous);
        for (word, kind) in clear.into_iter().chain(unclear) {
            given.take(word, kind)?;
        }
        Ok(given)
    }

    /// As [`given`](Self::given), for a command that receives no radar.
    pub fn given_recording(&self) -> Result<Given, InputError> {
        let given = self.given()?;
        match given.radar {
            Some(radar) => Err(InputError::Radar(radar)),
            None => Ok(given),
        }
    }

    /// Reads the named configuration; without a name, the configuration of the recording, which is
    /// then printed. The scans come from the recording, or from the configuration.
    pub fn configuration(&self) -> Result<Configuration, Failure> {
        self.configuration_of(&self.given_recording()?)
    }

    /// As [`configuration`](Self::configuration), of another recording that is read in the same
    /// way.
    pub fn configuration_with(&self, data: &Path) -> Result<Configuration, Failure> {
        self.configuration_of(&Given {
            data: Some(data.to_owned()),
            ..self.given_recording()?
        })
    }

    fn configuration_of(&self, given: &Given) -> Result<Configuration, Failure> {
        let configuration = match (&given.configuration, &given.data) {
            (Some(named), _) => configuration(named, &self.set)?,
            (None, Some(data)) => {
                let (configuration, sentence) = Configuration::of_recording(data, &self.set)?;
                print::note(sentence);
                configuration
            }
            (None, None) => Configuration::of_overrides(&self.set)?,
        };
        Ok(configuration.streaming(given.data.as_deref()))
    }
}

/// Reads a configuration by its path or its name, and prints the place of its files if that is not
/// clear.
pub fn configuration(named: &Path, overrides: &[String]) -> Result<Configuration, Failure> {
    let (configuration, notes) = Configuration::named(named, overrides)?;
    let notes = notes.iter();
    notes.for_each(|note| print::note(format_args!("gyre: {note}")));
    Ok(configuration)
}

impl Given {
    /// Adds the radar of an option.
    pub fn with_radar(mut self, radar: Option<&String>) -> Result<Self, InputError> {
        if let Some(radar) = radar {
            self.take(Path::new(radar), Kind::Radar)?;
        }
        match (&self.data, &self.radar) {
            (Some(data), Some(radar)) => {
                Err(InputError::Both(data.display().to_string(), radar.clone()))
            }
            _ => Ok(self),
        }
    }

    fn take(&mut self, word: &Path, kind: Kind) -> Result<(), InputError> {
        let text = word.display().to_string();
        match kind {
            Kind::Configuration => put(&mut self.configuration, word, "configurations"),
            Kind::Data => put(&mut self.data, word, "recordings"),
            Kind::Ambiguous if self.data.is_some() && self.configuration.is_none() => {
                put(&mut self.configuration, word, "configurations")
            }
            Kind::Ambiguous if self.configuration.is_some() && self.data.is_none() => {
                put(&mut self.data, word, "recordings")
            }
            Kind::Radar => match self.radar.replace(text.clone()) {
                Some(before) => Err(InputError::Twice(before, text, "addresses of radars")),
                None => Ok(()),
            },
            Kind::Ambiguous => Err(InputError::Ambiguous(text)),
            Kind::Results => Err(InputError::Results(text)),
            Kind::Unknown => {
                let suggestion = gyre_configuration::paths::suggestion(word);
                Err(InputError::Unknown(text, suggestion))
            }
        }
    }
}

fn put(place: &mut Option<PathBuf>, word: &Path, kinds: &'static str) -> Result<(), InputError> {
    match place.replace(word.to_owned()) {
        None => Ok(()),
        Some(before) => Err(InputError::Twice(
            before.display().to_string(),
            word.display().to_string(),
            kinds,
        )),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn given(words: &[&Path]) -> Result<Given, InputError> {
        let what = words.iter().map(|word| (*word).to_owned()).collect();
        Inputs {
            what,
            ..Inputs::default()
        }
        .given()
    }

    #[test]
    fn words_are_taken_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let (data, oxford) = (folder.path(), Path::new("oxford"));
        for words in [[data, oxford], [oxford, data]] {
            let given = given(&words).unwrap();
            assert_eq!(given.data.as_deref(), Some(data));
            assert_eq!(given.configuration.as_deref(), Some(oxford));
        }
        let radar = given(&[oxford, Path::new("192.168.0.1")]).unwrap().radar;
        assert_eq!(radar.as_deref(), Some("192.168.0.1"));
    }

    #[test]
    fn two_of_a_kind_and_what_names_nothing_are_refused() {
        let [oxford, boreas] = ["oxford", "boreas"].map(Path::new);
        let twice = given(&[oxford, boreas]).unwrap_err().to_string();
        assert_eq!(
            twice,
            "`oxford` and `boreas` are both configurations: name one"
        );
        let unknown = given(&[Path::new("oxfrod")]).unwrap_err().to_string();
        assert!(unknown.ends_with("; did you mean `oxford`?"), "{unknown}");
        let radar = Inputs {
            what: vec!["10.0.0.1".into()],
            ..Inputs::default()
        };
        assert!(matches!(radar.given_recording(), Err(InputError::Radar(_))));
    }
}
