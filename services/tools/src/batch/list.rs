//! The drives of a batch: a folder of recordings, a line for each, or a CSV file with a header.

use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs, io,
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::Failure;
use gyre_datasets::is_dataset;
use serde::{Deserialize, Serialize};

/// The largest list that is read, bytes: a million lines of 256.
const MAX_BYTES: u64 = 1 << 28;
/// The longest name, bytes: files are named after it.
const MAX_NAME: usize = 200;
const COLUMNS: [&str; 4] = ["drive", "name", "configuration", "set"];

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// The name, unique in the batch: the folder of its results.
    pub name: String,
    /// Path of a recording's folder, of a recorded run (`.mcap`) or of a configuration (`.toml`),
    /// as the list has it.
    pub path: String,
    /// Path of the configuration, as the list or the command has it; `None`: by the recording's
    /// format and scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub configuration: Option<PathBuf>,
    /// Overrides of the configuration, `section.key=value`; of two for one key the later one holds.
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

/// The lines that name drives: their numbers, and their cells in the order of the columns.
type Lines = Vec<(u64, [String; 4])>;

impl List {
    /// Reads a list. Relative paths in it are relative to its folder.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let shown = path.display();
        let unread = |error: io::Error| format!("cannot read the list of drives {shown}: {error}");
        let refused = |line: u64, reason: String| format!("{shown}, line {line}: {reason}");
        let mut folder = path.canonicalize().map_err(unread)?;
        let lines = match folder.is_dir() {
            // Sub-folders of a drive are not drives.
            true if is_dataset(&folder) => Lines::new(),
            true => entries(&folder).map_err(unread)?,
            false => {
                folder.pop();
                let text = gyre_storage::read_text(path, MAX_BYTES).map_err(unread)?;
                lines(&text).map_err(|(line, reason)| refused(line, reason))?
            }
        };
        let (mut drives, mut seen) = (Vec::new(), BTreeMap::new());
        for (number, line) in lines {
            let drive = drive(line).map_err(|reason| refused(number, reason))?;
            if let Some(first) = seen.insert(drive.name.clone(), number) {
                return Err(refused(number, format!("the drive of line {first} is named `{}` too: give them different names in the column `name`", drive.name)).into());
            }
            drives.push(drive);
        }
        match drives.is_empty() {
            false => Ok(Self { drives, folder }),
            true => Err(format!("{shown} names no drive: give a line for each, the path of its recording, or a folder whose sub-folders are recordings; `gyre run` computes one").into()),
        }
    }

    /// Gives all drives a configuration and overrides; a drive's own have precedence.
    pub fn with(mut self, configuration: Option<&Path>, set: &[String]) -> Self {
        for drive in &mut self.drives {
            if drive.configuration.is_none() && !ends_in(&drive.path, "toml") {
                drive.configuration = configuration.map(Path::to_owned);
            }
            drive.set = [set, drive.set.as_slice()].concat();
        }
        self
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

    pub fn resolve(&self, path: impl AsRef<Path>) -> PathBuf {
        self.folder.join(path)
    }
}

/// Returns the sub-folders of a folder, and the recorded runs in it, by name.
fn entries(folder: &Path) -> io::Result<Lines> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // macOS adds files of its own to an archive.
        let is_hidden = name.starts_with('.') || name == "__MACOSX";
        if !is_hidden && (path.is_dir() || ends_in(&path, "mcap")) {
            names.push(name.into_owned());
        }
    }
    names.sort();
    Ok((1..).zip(names.into_iter().map(cells)).collect())
}

/// Returns the cells of a line that is a path.
fn cells(path: String) -> [String; 4] {
    [path, String::new(), String::new(), String::new()]
}

/// The error is the number of a line, and its fault.
fn lines(text: &str) -> Result<Lines, (u64, String)> {
    let lines = (1..).zip(text.lines().map(str::trim));
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let is_header = |line: &str| line.split(',').any(|column| column.trim() == "drive");
    match lines.clone().next() {
        Some((_, first)) if is_header(first) => table(text),
        _ => Ok(lines
            .map(|(line, path)| (line, cells(path.to_owned())))
            .collect()),
    }
}

fn table(text: &str) -> Result<Lines, (u64, String)> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let fault = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        (line, error.to_string())
    };
    let header = reader.headers().map_err(fault)?.clone();
    if let Some(column) = header.iter().find(|it| !COLUMNS.contains(it)) {
        let known = COLUMNS.join(", ");
        let unknown = format!("there is no column `{column}`; there are {known}");
        return Err((1, unknown));
    }
    let places = COLUMNS.map(|column| header.iter().position(|it| it == column));
    let mut lines = Lines::new();
    for record in reader.records() {
        let record = record.map_err(fault)?;
        let line = record.position().map_or(1, csv::Position::line);
        let cell = |place: Option<usize>| place.and_then(|place| record.get(place));
        lines.push((line, places.map(|it| cell(it).unwrap_or("").to_owned())));
    }
    Ok(lines)
}

fn ends_in(path: impl AsRef<Path>, extension: &str) -> bool {
    path.as_ref().extension().is_some_and(|it| it == extension)
}

/// Returns the drive of a line, named after its path unless the line names it.
fn drive([path, name, configuration, set]: [String; 4]) -> Result<Drive, String> {
    if path.is_empty() {
        return Err("the column `drive` is empty: it is the path of the recording".to_owned());
    }
    let name = match ends_in(&path, "mcap") || ends_in(&path, "toml") {
        _ if !name.is_empty() => Some(OsStr::new(&name)),
        true => Path::new(&path).file_stem(),
        false => Path::new(&path).file_name(),
    };
    let none = || format!("`{path}` has no name: give one in the column `name`");
    let name = name.and_then(OsStr::to_str).ok_or_else(none)?.to_owned();
    let is_special = |c: char| c == '/' || c.is_control();
    if name.starts_with('.') || name.len() > MAX_NAME || name.contains(is_special) {
        return Err(format!(
            "`{name}` cannot be the name of a drive: files are named after it, so it begins with no dot, has no slash and at most \
             {MAX_NAME} bytes; give a different name in the column `name`"
        ));
    }
    let unclosed = || format!("the column `set` is `{set}`, with a quote that is not closed");
    Ok(Drive {
        configuration: (!configuration.is_empty()).then(|| configuration.into()),
        set: shlex::split(&set).ok_or_else(unclosed)?,
        name,
        path,
    })
}

#[cfg(test)]
mod tests {
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
