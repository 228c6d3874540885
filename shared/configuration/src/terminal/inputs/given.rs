//! The arguments and the inputs that they name.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::{
    Configuration,
    paths::suggestion,
    terminal::{Failure, inputs::kind::Kind, print},
};

/// The words that name the inputs of a command.
#[derive(Clone, Debug, Default, Args)]
pub struct Inputs {
    /// The recording (a folder, NAME.mcap, a bag of ROS 2), the configuration (a TOML file, or a
    /// name that `gyre config` lists) or the address of a radar, in any order. Defaults: the
    /// recording of the configuration; settings from the recording's format and its scans.
    #[arg(value_name = "WHAT")]
    pub what: Vec<PathBuf>,
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
    pub radar: Option<String>,
}

impl Inputs {
    pub fn given(&self) -> Result<Given, Failure> {
        let mut given = Given::default();
        self.what.iter().try_for_each(|word| given.take(word))?;
        match (&given.data, &given.radar) {
            (Some(data), Some(radar)) => Err(format!(
                "`{}` is a recording and `{radar}` the address of a radar: name one",
                data.display()
            )
            .into()),
            _ => Ok(given),
        }
    }

    /// As [`given`](Self::given), for a command that receives no radar.
    pub fn given_recording(&self) -> Result<Given, Failure> {
        let given = self.given()?;
        match given.radar {
            Some(radar) => Err(format!(
                "`{radar}` is the address of a radar, and only `gyre run` and `gyre up` receive one: name a recording"
            )
            .into()),
            None => Ok(given),
        }
    }

    /// The scans come from the recording, or from the configuration.
    pub fn configuration(&self) -> Result<Configuration, Failure> {
        self.configuration_of(&self.given_recording()?)
    }

    /// As [`configuration`](Self::configuration), of another recording.
    pub fn configuration_with(&self, data: &Path) -> Result<Configuration, Failure> {
        self.configuration_of(&Given {
            data: Some(data.to_owned()),
            ..self.given_recording()?
        })
    }

    fn configuration_of(&self, given: &Given) -> Result<Configuration, Failure> {
        let configuration = given.read(&self.set)?;
        Ok(configuration.streaming(given.data.as_deref()))
    }
}

/// Reads a configuration, or the defaults. Prints the place of its files if that is not clear.
pub fn configuration(named: Option<&Path>, overrides: &[String]) -> Result<Configuration, Failure> {
    let Some(named) = named else {
        return Ok(Configuration::of_overrides(overrides)?);
    };
    let (configuration, notes) = Configuration::named(named, overrides)?;
    let notes = notes.iter();
    notes.for_each(|note| print::note(format_args!("gyre: {note}")));
    Ok(configuration)
}

impl Given {
    /// Reads the named configuration, or finds and prints the settings of the recording.
    pub fn read(&self, overrides: &[String]) -> Result<Configuration, Failure> {
        match (&self.configuration, &self.data) {
            (None, Some(data)) => {
                let (configuration, sentence) = Configuration::of_recording(data, overrides)?;
                print::note(sentence);
                Ok(configuration)
            }
            (named, _) => configuration(named.as_deref(), overrides),
        }
    }

    fn take(&mut self, word: &Path) -> Result<(), Failure> {
        let text = word.display().to_string();
        let (before, kinds) = match Kind::of(word) {
            Kind::Configuration => (
                self.configuration.replace(word.to_owned()),
                "configurations",
            ),
            Kind::Data => (self.data.replace(word.to_owned()), "recordings"),
            Kind::Radar => {
                let before = self.radar.replace(text.clone());
                (before.map(PathBuf::from), "addresses of radars")
            }
            Kind::Results => {
                return Err(format!(
                    "{text} has the results of a run: name {text}/config.toml to compute them again, or export a recording of it (`gyre export`)"
                )
                .into());
            }
            Kind::Unknown => {
                let suggestion = suggestion(word);
                return Err(format!(
                    "`{text}` is no file or folder, no name that `gyre config` lists, and not the address of a radar{suggestion}"
                )
                .into());
            }
        };
        match before {
            None => Ok(()),
            Some(before) => {
                let before = before.display();
                Err(format!("`{before}` and `{text}` are both {kinds}: name one").into())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(words: &[&Path]) -> Result<Given, Failure> {
        inputs(words).given()
    }

    fn inputs(words: &[&Path]) -> Inputs {
        Inputs {
            what: words.iter().map(|word| (*word).to_owned()).collect(),
            set: Vec::new(),
        }
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
        assert!(inputs(&[Path::new("10.0.0.1")]).given_recording().is_err());
    }
}
