//! The paths of a configuration: relative to it, or files of the program.

use std::{
    env,
    path::{Path, PathBuf},
};

use gyre_geometry::samples::SampleKind;
use toml::{Table, Value};

use crate::{ConfigurationError, strict};

const KEYS: [&str; 11] = [
    "run.ground_truth",
    "source.data",
    "source.commands",
    "simulation.drive.file",
    "masking.model",
    "masking.runtime",
    "slam.map",
    RECORDING,
    "link.ca",
    "link.certificate",
    "link.key",
];
const RECORDING: &str = "record.file";

/// A configuration as its file has it, but with each path absolute, or a file of the program.
#[derive(Clone, Debug)]
pub struct Named {
    pub table: Table,
    /// Keys, and sentences about files in the current folder that are used, or are not, for as long
    /// as no others take their places.
    notes: Vec<(String, String)>,
}

impl Named {
    /// Reads the configuration of this path, or of this name in the program. A relative path in it
    /// is one beside it, else of the program, else, with a note, in the current folder.
    pub fn read(named: &Path) -> Result<Self, ConfigurationError> {
        Self::read_in(named, env::current_dir().ok())
    }

    /// As [`read`](Self::read), with this folder as the current one. `None`: it is not searched.
    pub fn read_in(named: &Path, here: Option<PathBuf>) -> Result<Self, ConfigurationError> {
        let own = shipped(named);
        let mut table = match own.as_deref().and_then(gyre_storage::shipped::text) {
            Some(text) => strict::parse(named, text)?,
            None if is_name(named) && !named.exists() => return Err(unknown(named)),
            None => strict::read_table(named)?,
        };
        let file = match &own {
            Some(_) => named.to_owned(),
            None => std::path::absolute(named).unwrap_or_else(|_| named.to_owned()),
        };
        let folder = file.parent().filter(|_| own.is_none());
        let mut notes = Vec::new();
        visit(&mut table, |path, key| {
            let written = Path::new(path.as_str());
            if path.is_empty() || written.is_absolute() || gyre_storage::shipped::is_own(written) {
                return Ok(());
            }
            let beside = folder.map(|folder| folder.join(written));
            let is_beside = |path: &PathBuf| key == RECORDING || path.exists();
            let own = || gyre_storage::shipped::find(written);
            let found = beside.clone().filter(is_beside).or_else(own);
            let here = here.as_deref().map(|here| here.join(written));
            match (found, here.filter(|here| here.exists())) {
                (None, Some(here)) => {
                    let sentence = format!(
                        "{key}: {path} is taken from the current folder, as it is not beside {}, where the paths of a configuration start",
                        named.display()
                    );
                    notes.push((key.to_owned(), sentence));
                    put(path, here)
                }
                (Some(own), Some(here)) if differs(&own, &here) => {
                    let here = here.display();
                    let sentence = format!(
                        "{key}: {path} is that of the program, and {here} differs: to use that, name it by its whole path"
                    );
                    notes.push((key.to_owned(), sentence));
                    put(path, own)
                }
                (found, _) => found.or(beside).map_or(Ok(()), |found| put(path, found)),
            }
        })?;
        Ok(Self { table, notes })
    }

    /// Returns sentences about the paths which `changed`, with overrides, still has.
    pub fn notes(&self, changed: &Table) -> Vec<String> {
        let notes = self.notes.iter();
        let notes = notes.filter(|(key, _)| value(&self.table, key) == value(changed, key));
        notes.map(|(_, sentence)| sentence.clone()).collect()
    }
}

/// Replaces each relative path of an existing file by its absolute path, so that the resolved
/// configuration names the same file from any folder. Other paths of the command line become the
/// path of the program's file of that name.
pub fn resolve(table: &mut Table) -> Result<(), ConfigurationError> {
    visit(table, |path, key| {
        let written = Path::new(path.as_str());
        if path.is_empty() || gyre_storage::shipped::is_own(written) {
            return Ok(());
        }
        let found = match written.exists() {
            // The program of a virtual environment is known by the name of its link.
            true if key.ends_with(".command") => std::path::absolute(written).ok(),
            true if key != RECORDING => written.canonicalize().ok(),
            _ if key == RECORDING => std::path::absolute(written).ok(),
            _ => gyre_storage::shipped::find(written),
        };
        found.map_or(Ok(()), |found| put(path, found))
    })
}

fn put(path: &mut String, found: PathBuf) -> Result<(), ConfigurationError> {
    *path = strict::text_of(&found)?.to_owned();
    Ok(())
}

/// Visits the paths of all keys, and the paths in the commands of stages: the program, others that
/// begin with a dot, and a function of Python.
fn visit(
    table: &mut Table,
    mut each: impl FnMut(&mut String, &str) -> Result<(), ConfigurationError>,
) -> Result<(), ConfigurationError> {
    let logs = SampleKind::ALL.map(|kind| format!("{}.file", kind.section()));
    for key in KEYS.into_iter().chain(logs.iter().map(String::as_str)) {
        if let Some(Value::String(path)) = value_mut(table, key) {
            each(path, key)?;
        }
    }
    let Some(Value::Table(stages)) = table.get_mut("stages") else {
        return Ok(());
    };
    for (name, stage) in stages.iter_mut() {
        let command = stage.get_mut("command").and_then(Value::as_array_mut);
        for (index, word) in command.into_iter().flatten().enumerate() {
            let Value::String(word) = word else { continue };
            let has_dot = word.starts_with("./") || word.starts_with("../");
            if has_dot || (index == 0 && word.contains('/')) {
                each(word, &format!("stages.{name}.command"))?;
            }
        }
        if let Some(Value::String(file)) = stage.get_mut("python") {
            each(file, &format!("stages.{name}.python"))?;
        }
    }
    Ok(())
}

/// Returns the path of the configuration of the program that is meant: where there is no such file.
pub fn shipped(named: &Path) -> Option<PathBuf> {
    if gyre_storage::shipped::is_own(named) {
        return Some(named.to_owned());
    }
    let is_configuration = |path: &PathBuf| path.extension().is_some_and(|it| it == "toml");
    let find = || gyre_storage::shipped::find(named).filter(is_configuration);
    match named.is_file() {
        true => None,
        false => gyre_storage::shipped::configuration(named).or_else(find),
    }
}

/// Returns a question for the configuration of the program with the nearest name; empty without a
/// similar name.
pub fn suggestion(named: &Path) -> String {
    let known: Vec<&str> = gyre_storage::shipped::configurations()
        .map(|(it, _)| it)
        .collect();
    strict::suggestion(&named.display().to_string(), &known)
}

/// Returns the error for a name that neither a file nor a configuration of the program has.
pub fn unknown(named: &Path) -> ConfigurationError {
    let (name, suggestion) = (named.display(), suggestion(named));
    ConfigurationError(format!(
        "`{name}` is neither a file nor a configuration of the program, which `gyre config` lists{suggestion}"
    ))
}

fn is_name(named: &Path) -> bool {
    named.extension().is_none() && named.file_name() == Some(named.as_os_str())
}

/// Returns whether a file of the program is another than this one.
fn differs(own: &Path, file: &Path) -> bool {
    gyre_storage::shipped::bytes(own).is_some_and(|own| {
        let read = gyre_storage::read_bytes(file, own.len() as u64);
        read.ok().as_deref() != Some(own)
    })
}

fn value<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let (first, rest) = key.split_once('.')?;
    let mut parts = rest.split('.');
    parts.try_fold(table.get(first)?, |value, part| value.get(part))
}

fn value_mut<'a>(table: &'a mut Table, key: &str) -> Option<&'a mut Value> {
    let (first, rest) = key.split_once('.')?;
    let mut parts = rest.split('.');
    parts.try_fold(table.get_mut(first)?, |value, part| value.get_mut(part))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A folder with a configuration in `robot/` and the current folder `here/`.
    fn read(files: &[&str], text: &str) -> (tempfile::TempDir, Named) {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let file = folder.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "").unwrap();
        }
        let file = folder.path().join("robot/run.toml");
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, text).unwrap();
        let named = Named::read_in(&file, Some(folder.path().join("here"))).unwrap();
        (folder, named)
    }

    fn at(named: &Named, key: &str) -> PathBuf {
        value(&named.table, key).unwrap().as_str().unwrap().into()
    }

    const MODEL: &str = "[masking]\nmodel = 'models/gyre-255.toml'\n";

    #[test]
    fn a_path_is_one_beside_the_configuration_also_of_what_is_nowhere_or_to_be_written() {
        let models = ["robot/models/gyre-255.toml", "here/models/gyre-255.toml"];
        let (map, recording) = ("[slam]\nmap = 'a.map'\n", "[record]\nfile = 'a.mcap'\n");
        for (files, text, key, beside) in [
            (&models[..], MODEL, "masking.model", models[0]),
            (&[], map, "slam.map", "robot/a.map"),
            (&["here/a.mcap"], recording, "record.file", "robot/a.mcap"),
        ] {
            let (folder, named) = read(files, text);
            assert_eq!(at(&named, key), folder.path().join(beside));
            assert!(named.notes(&named.table).is_empty(), "{key}");
        }
    }

    #[test]
    fn a_file_of_the_program_goes_before_one_in_the_current_folder_which_is_named() {
        let own = Path::new("gyre:models/gyre-255.toml");
        let (_folder, named) = read(&[], MODEL);
        assert_eq!(at(&named, "masking.model"), own);
        assert!(named.notes(&named.table).is_empty());
        let (_folder, named) = read(&["here/models/gyre-255.toml"], MODEL);
        assert_eq!(at(&named, "masking.model"), own);
        let note = &named.notes(&named.table)[0];
        assert!(note.contains("is that of the program, and"), "{note}");
    }

    #[test]
    fn the_current_folder_is_the_last_resort_and_is_named_unless_the_key_is_overridden() {
        let text = "[source]\ndata = 'drive'\n";
        let (folder, named) = read(&["here/drive/1.png"], text);
        assert_eq!(at(&named, "source.data"), folder.path().join("here/drive"));
        let note = &named.notes(&named.table)[0];
        assert!(note.contains("is taken from the current folder"), "{note}");
        let mut changed = named.table.clone();
        strict::set(&mut changed, "source.data=/other").unwrap();
        assert!(named.notes(&changed).is_empty());
    }

    #[test]
    fn the_program_of_a_stage_is_beside_the_configuration_and_one_on_the_path_stays() {
        let text = "[stages.masking]\ncommand = ['./mask', '-f', './a.py', 'b.py']\n\
            [stages.refinement]\ncommand = ['python3', 'here/b.py']\n\
            [stages.rotation-search]\npython = 'a.py'\n";
        let (folder, named) = read(&["robot/mask", "robot/a.py"], text);
        let python = at(&named, "stages.rotation-search.python");
        assert_eq!(python, folder.path().join("robot/a.py"));
        let words = |stage: &str| -> Vec<String> {
            let command = value(&named.table, &format!("stages.{stage}.command"));
            let words = command.unwrap().as_array().unwrap().iter();
            words.map(|it| it.as_str().unwrap().to_owned()).collect()
        };
        let beside = |name: &str| format!("{}/robot/./{name}", folder.path().display());
        assert_eq!(
            words("masking"),
            [beside("mask"), "-f".into(), beside("a.py"), "b.py".into()]
        );
        assert_eq!(words("refinement"), ["python3", "here/b.py"]);
    }

    #[test]
    fn a_configuration_of_the_program_is_read_by_its_name_with_its_files() {
        let named = Named::read_in(Path::new("stop-and-go"), None).unwrap();
        let own = Path::new("gyre:configs/stop-and-go.tum");
        assert_eq!(at(&named, "simulation.drive.file"), own);
        let unknown = Named::read_in(Path::new("oxfrod"), None).unwrap_err();
        let unknown = unknown.to_string();
        assert!(unknown.contains("did you mean `oxford`?"), "{unknown}");
    }

    #[test]
    fn each_path_of_the_command_line_is_one_here_or_of_the_program() {
        let own: Vec<String> = KEYS.iter().map(|key| format!("{key}=src")).collect();
        let mut table: Table = "[stages.masking]\npython = 'src'\n".parse().unwrap();
        for setting in own {
            strict::set(&mut table, &setting).unwrap();
        }
        resolve(&mut table).unwrap();
        let here = Path::new("src").canonicalize().unwrap();
        for key in KEYS.into_iter().chain(["stages.masking.python"]) {
            let path = value(&table, key).unwrap().as_str().unwrap();
            assert_eq!(Path::new(path), here, "{key}");
        }
        let mut table: Table = MODEL.parse().unwrap();
        strict::set(&mut table, "gyro.file=nowhere.csv").unwrap();
        strict::set(&mut table, "record.file=new.mcap").unwrap();
        resolve(&mut table).unwrap();
        let named = |key: &str| value(&table, key).unwrap().as_str().unwrap();
        assert_eq!(named("masking.model"), "gyre:models/gyre-255.toml");
        assert_eq!(named("gyro.file"), "nowhere.csv");
        assert!(Path::new(named("record.file")).is_absolute());
    }
}
