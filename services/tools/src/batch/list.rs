//! The drives of a batch: a folder of recordings, a line for each, or a CSV file with a header.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use gyre_datasets::is_dataset;
use gyre_terminal::Failure;
use serde::{Deserialize, Serialize};

/// The largest list that is read, bytes: a million lines of 256.
const MAX_BYTES: u64 = 1 << 28;
/// The longest name, bytes: files are named after it.
const MAX_NAME: usize = 200;
/// The column that makes a first line a header.
const DRIVE: &str = "drive";
const COLUMNS: [&str; 4] = [DRIVE, "name", "configuration", "set"];

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// The name, unique in the batch: the folder of its results.
    pub name: String,
    /// Path of a recording's folder, of a recorded run (`.mcap`) or of a configuration (`.toml`),
    /// as the list has it.
    pub path: String,
    /// Path of the configuration, as the list has it; `None`: the configuration of the batch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub configuration: Option<String>,
    /// Overrides of the configuration, `section.key=value`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
}

/// The drives of a batch, in the order of its table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct List {
    pub drives: Vec<Drive>,
    /// The absolute path of the folder: paths are relative to it.
    folder: PathBuf,
}

/// The drives of a list, or their faults, with the numbers of their lines.
type Lines = Vec<(u64, Result<Drive, String>)>;

impl List {
    /// Reads a list. Relative paths in it are relative to its folder.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let shown = path.display();
        let unread = |error: io::Error| format!("cannot read the list of drives {shown}: {error}");
        let absolute = path.canonicalize().map_err(unread)?;
        let (lines, folder) = match absolute.is_dir() {
            // Sub-folders of a drive are not drives.
            true if is_dataset(&absolute) => (Lines::new(), absolute),
            true => (entries(path).map_err(unread)?, absolute),
            false => {
                let text = gyre_storage::read_text(path, MAX_BYTES).map_err(unread)?;
                let folder = absolute.parent().unwrap_or(Path::new("/"));
                (lines(&text), folder.to_owned())
            }
        };
        let (mut drives, mut seen) = (Vec::new(), BTreeMap::new());
        for (line, drive) in lines {
            let refused = |reason| format!("{shown}, line {line}: {reason}");
            let drive = drive.map_err(refused)?;
            if let Some(first) = seen.insert(drive.name.clone(), line) {
                let name = drive.name;
                return Err(refused(format!("the drive of line {first} is named `{name}` too: give them different names in the column `name`")).into());
            }
            drives.push(drive);
        }
        match drives.is_empty() {
            false => Ok(Self { drives, folder }),
            true => Err(format!("{shown} names no drive: give a line for each, the path of its recording, or a folder whose sub-folders are recordings; `gyre run` computes one").into()),
        }
    }

    /// Returns the drives of a task, counted from 0, of so many: each `tasks`-th drive, so that
    /// long drives that are neighbours are divided.
    pub fn share(&self, task: usize, tasks: usize) -> Result<Vec<Drive>, Failure> {
        if task >= tasks {
            let last = tasks.saturating_sub(1);
            return Err(format!(
                "there is no task {task} of {tasks}: tasks count from 0, so the last one is {last}"
            )
            .into());
        }
        let drives = self.drives.iter().skip(task).step_by(tasks);
        Ok(drives.cloned().collect())
    }

    pub fn resolve(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }
}

/// Returns the sub-folders of a folder, and the recorded runs in it, by name.
fn entries(folder: &Path) -> io::Result<Lines> {
    let entries: io::Result<Vec<_>> = fs::read_dir(folder)?.collect();
    let entries = entries?.into_iter();
    let drives = entries.filter(|entry| is_drive(&entry.path()));
    let mut names: Vec<_> = drives.map(|entry| entry.file_name()).collect();
    names.sort();
    let drive = |name: std::ffi::OsString| match name.to_str() {
        Some(name) => Drive::of(name, None),
        None => Err(format!("the name {name:?} is not UTF-8")),
    };
    Ok((1..).zip(names.into_iter().map(drive)).collect())
}

fn is_drive(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    // macOS adds files of its own to an archive.
    !name.starts_with(b".") && name != b"__MACOSX" && (path.is_dir() || is_recorded(path))
}

fn is_recorded(path: &Path) -> bool {
    path.extension().is_some_and(|it| it == "mcap")
}

fn lines(text: &str) -> Lines {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = (1..).zip(text.lines().map(str::trim));
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let is_header = |line: &str| line.split(',').any(|column| column.trim() == DRIVE);
    match lines.clone().next() {
        Some((_, first)) if is_header(first) => table(text),
        _ => lines
            .map(|(line, path)| (line, Drive::of(path, None)))
            .collect(),
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Line {
    drive: String,
    name: Option<String>,
    configuration: Option<String>,
    set: String,
}

fn table(text: &str) -> Lines {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = match reader.headers() {
        Ok(header) => header.clone(),
        Err(error) => return vec![(1, Err(error.to_string()))],
    };
    if let Some(column) = header.iter().find(|it| !COLUMNS.contains(it)) {
        let known = COLUMNS.join(", ");
        let unknown = format!("there is no column `{column}`; there are {known}");
        return vec![(1, Err(unknown))];
    }
    let drive = |record: csv::Result<csv::StringRecord>| {
        let position = match &record {
            Ok(record) => record.position(),
            Err(error) => error.position(),
        };
        let line = position.map_or(0, csv::Position::line);
        let read = record.and_then(|record| record.deserialize::<Line>(Some(&header)));
        let drive = read.map_err(|error| error.to_string());
        (line, drive.and_then(Line::drive))
    };
    reader.into_records().map(drive).collect()
}

impl Line {
    fn drive(self) -> Result<Drive, String> {
        let (path, set) = (&self.drive, &self.set);
        if path.is_empty() {
            return Err("the column `drive` is empty: it is the path of the recording".to_owned());
        }
        if self.configuration.is_some() && is_configuration(path) {
            return Err(format!(
                "`{path}` is a configuration itself: leave its column `configuration` empty"
            ));
        }
        let unclosed = || format!("the column `set` is `{set}`, with a quote that is not closed");
        Ok(Drive {
            set: shlex::split(set).ok_or_else(unclosed)?,
            configuration: self.configuration.clone(),
            ..Drive::of(path, self.name.as_deref())?
        })
    }
}

/// Returns whether a drive is a configuration, of a simulation for instance.
pub(crate) fn is_configuration(path: &str) -> bool {
    Path::new(path).extension().is_some_and(|it| it == "toml")
}

impl Drive {
    /// Returns a drive by its path, and by that its name unless it has its own.
    fn of(path: &str, name: Option<&str>) -> Result<Self, String> {
        let of_path = Path::new(path);
        let last = match is_recorded(of_path) || is_configuration(path) {
            true => of_path.file_stem(),
            false => of_path.file_name(),
        };
        let none = || format!("`{path}` has no name: give one in the column `name`");
        let name = name
            .or(last.and_then(|last| last.to_str()))
            .ok_or_else(none)?;
        let is_plain = |c: char| c != '/' && !c.is_control();
        let is_valid = !name.starts_with('.') && (1..=MAX_NAME).contains(&name.len());
        match is_valid && name.chars().all(is_plain) {
            true => Ok(Self {
                name: name.to_owned(),
                path: path.to_owned(),
                configuration: None,
                set: Vec::new(),
            }),
            false => Err(format!(
                "`{name}` cannot be the name of a drive: files are named after it, so it begins with no dot, has no slash and at most \
                 {MAX_NAME} bytes; give a different name in the column `name`"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn read(text: &str) -> Result<List, Failure> {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("drives.csv");
        fs::write(&list, text).unwrap();
        List::read(&list)
    }

    fn refusal(text: &str) -> String {
        let error = read(text).unwrap_err().to_string();
        error.split_once("drives.csv").unwrap().1.to_owned()
    }

    #[test]
    fn a_line_is_a_path_and_names_the_drive() {
        let list = read("# two drives\n/data/a, b/\n\nruns/c.mcap\nsim.toml\n").unwrap();
        let named = |drive: &Drive| format!("{}: {}", drive.name, drive.path);
        let named: Vec<_> = list.drives.iter().map(named).collect();
        let expected = ["a, b: /data/a, b/", "c: runs/c.mcap", "sim: sim.toml"];
        assert_eq!(named, expected);
        assert_eq!(list.resolve("/data/x"), Path::new("/data/x"));
        assert!(list.resolve("runs/c.mcap").is_absolute());
    }

    #[test]
    fn columns_name_drives_and_set_keys() {
        let text = "name,drive,set\nfirst, x/radar,raster.n=127 'masking.model=a b'\n# no\n,y,\n";
        let list = read(text).unwrap();
        let [first, second] = &list.drives[..] else {
            panic!("{list:?}")
        };
        assert_eq!(first.name, "first");
        assert_eq!(first.set, ["raster.n=127", "masking.model=a b"]);
        assert_eq!((second.name.as_str(), second.set.len()), ("y", 0));
    }

    #[test]
    fn a_list_that_is_wrong_names_the_line() {
        for (text, words) in [
            ("a/radar\n\nb/radar\n", ", line 3: the drive of line 1 is"),
            ("drive,sett\na,b\n", ", line 1: there is no column `sett`"),
            ("drive,set\na,b='\n", ", line 2: the column `set` is `b='`"),
            ("drive,name\n,b\n", ", line 2: the column `drive` is empty"),
            ("drive,name\na,b/c\n", ", line 2: `b/c` cannot be"),
            ("a\n..\n", ", line 2: `..` has no name"),
            ("drive,name\na\n", ", line 2: "),
            ("# nothing\n\n", " names no drive"),
            ("drive,name\n", " names no drive"),
        ] {
            let said = refusal(text);
            assert!(said.starts_with(words), "{said}");
        }
    }

    #[test]
    fn a_folder_is_the_list_of_its_recordings() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b", "a", ".hidden", "__MACOSX"] {
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        for name in ["run.mcap", "notes.txt"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let list = List::read(folder.path()).unwrap();
        let names: Vec<_> = list.drives.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["a", "b", "run"]);
        assert!(list.resolve(&list.drives[0].path).is_dir());
        fs::create_dir(folder.path().join("navtech")).unwrap();
        fs::write(folder.path().join("navtech/1.png"), "").unwrap();
        let refused = List::read(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("names no drive"), "{refused}");
    }

    #[test]
    fn tasks_share_the_drives_out() {
        let list = read("a\nb\nc\nd\ne\n").unwrap();
        let all = (0..3).flat_map(|task| list.share(task, 3).unwrap());
        let mut all: Vec<_> = all.map(|drive| drive.name).collect();
        all.sort();
        assert_eq!(all, ["a", "b", "c", "d", "e"]);
        assert_eq!(list.share(7, 8).unwrap(), []);
        let error = list.share(3, 3).unwrap_err();
        assert!(error.to_string().contains("the last one is 2"), "{error}");
    }
}
