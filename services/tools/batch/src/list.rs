//! The drives of a batch: a folder of recordings, a line for each, or a CSV file with a header.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use gyre_datasets::is_dataset;
use serde::{Deserialize, Serialize};

use crate::BatchError;

/// The largest list that is read, bytes: a million lines of 256.
const MAX_BYTES: u64 = 1 << 28;
/// The longest name, bytes: files are named after it.
const MAX_NAME: usize = 200;
/// The column that makes a first line a header.
const DRIVE: &str = "drive";
const COLUMNS: [&str; 4] = [DRIVE, "name", "configuration", "set"];

/// A drive of a batch.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// The name, which no other drive of the batch has: the folder of its results.
    pub name: String,
    /// Path of a recording's folder, of a recorded run (`.mcap`) or of a configuration (`.toml`),
    /// as the list has it.
    pub path: String,
    /// Path of the configuration, as the list has it; `None`: that of the batch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub configuration: Option<String>,
    /// Overrides of the configuration, `section.key=value`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
}

/// The part of a batch that one of many tasks computes: each `tasks`-th drive, so that long drives
/// that lie side by side are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slice {
    /// The task, from 0.
    pub task: usize,
    /// The number of tasks.
    pub tasks: usize,
}

/// The drives of a batch, in the order of its table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct List {
    drives: Vec<Drive>,
    /// The absolute path of the folder to which paths are relative.
    folder: PathBuf,
}

impl List {
    /// Reads a list. Relative paths in it are relative to its folder.
    ///
    /// # Errors
    /// A list that cannot be read, is empty, or has a line that is no drive; two drives of one
    /// name.
    pub fn read(path: &Path) -> Result<Self, BatchError> {
        let unread = |source| BatchError::List {
            path: path.to_owned(),
            source,
        };
        let absolute = path.canonicalize().map_err(unread)?;
        let (lines, folder) = match absolute.is_dir() {
            // Sub-folders of a drive are not drives.
            true if is_dataset(&absolute) => (Vec::new(), absolute),
            true => (entries(path)?, absolute),
            false => {
                let text = gyre_storage::read_text(path, MAX_BYTES).map_err(unread)?;
                let folder = absolute.parent().unwrap_or(Path::new("/")).to_owned();
                (lines(path, &text)?, folder)
            }
        };
        if lines.is_empty() {
            return Err(BatchError::Empty {
                path: path.to_owned(),
            });
        }
        require_unique(path, &lines)?;
        let drives = lines.into_iter().map(|(_, drive)| drive).collect();
        Ok(Self { drives, folder })
    }

    /// Returns all drives.
    pub fn drives(&self) -> &[Drive] {
        &self.drives
    }

    /// Returns the drives of a task.
    ///
    /// # Errors
    /// There is no such task.
    pub fn slice(&self, slice: Slice) -> Result<Vec<Drive>, BatchError> {
        let Slice { task, tasks } = slice;
        if task >= tasks {
            return Err(BatchError::NoSuchTask { task, tasks });
        }
        let drives = self.drives.iter().skip(task).step_by(tasks);
        Ok(drives.cloned().collect())
    }

    /// Returns the absolute form of a path of this list.
    pub fn resolve(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }
}

/// Returns the sub-folders of a folder, and the recorded runs in it, by name.
fn entries(folder: &Path) -> Result<Vec<(u64, Drive)>, BatchError> {
    let unread = |source| BatchError::List {
        path: folder.to_owned(),
        source,
    };
    let entries = fs::read_dir(folder).map_err(unread)?;
    let entries: io::Result<Vec<_>> = entries.collect();
    let mut names: Vec<_> = entries
        .map_err(unread)?
        .into_iter()
        .filter(|entry| is_drive(&entry.path()))
        .map(|entry| entry.file_name())
        .collect();
    names.sort();
    let drive = |(line, name): (u64, &std::ffi::OsString)| {
        let failed = |reason| line_error(folder, line)(reason);
        let text = name.to_str();
        let text = text.ok_or_else(|| failed(format!("the name {name:?} is not UTF-8")))?;
        Ok((line, drive(text, None).map_err(failed)?))
    };
    (1..).zip(&names).map(drive).collect()
}

fn is_drive(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    // macOS puts files of its own beside those of an archive.
    !name.starts_with(b".") && name != b"__MACOSX" && (path.is_dir() || is_recorded(path))
}

fn is_recorded(path: &Path) -> bool {
    path.extension().is_some_and(|it| it == "mcap")
}

/// Returns whether a drive is a configuration, that of a simulation for instance.
pub(crate) fn is_configuration(path: &str) -> bool {
    Path::new(path).extension().is_some_and(|it| it == "toml")
}

/// Returns the drives of a text, with their lines.
fn lines(path: &Path, text: &str) -> Result<Vec<(u64, Drive)>, BatchError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = (1..).zip(text.lines().map(str::trim));
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let is_header = |line: &str| line.split(',').any(|column| column.trim() == DRIVE);
    match lines.clone().next() {
        Some((_, first)) if is_header(first) => table(path, text),
        _ => lines
            .map(|(line, text)| {
                let drive = drive(text, None);
                Ok((line, drive.map_err(line_error(path, line))?))
            })
            .collect(),
    }
}

/// Returns the drives of a CSV file with a header.
fn table(path: &Path, text: &str) -> Result<Vec<(u64, Drive)>, BatchError> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let failed = |error: csv::Error| {
        let line = error.position().map_or(0, csv::Position::line);
        line_error(path, line)(error.to_string())
    };
    let header = reader.headers().map_err(failed)?.clone();
    if let Some(column) = header.iter().find(|it| !COLUMNS.contains(it)) {
        let reason = format!(
            "there is no column `{column}`; there are {}",
            COLUMNS.join(", ")
        );
        return Err(line_error(path, 1)(reason));
    }
    let mut drives = Vec::new();
    for record in reader.records() {
        let record = record.map_err(failed)?;
        let line = record.position().map_or(0, csv::Position::line);
        let cells = header.iter().zip(&record);
        let cells: BTreeMap<_, _> = cells.filter(|(_, cell)| !cell.is_empty()).collect();
        drives.push((line, of_cells(&cells).map_err(line_error(path, line))?));
    }
    Ok(drives)
}

fn of_cells(cells: &BTreeMap<&str, &str>) -> Result<Drive, String> {
    let path = cells
        .get(DRIVE)
        .ok_or("the column `drive` is empty: it is the path of the recording")?;
    let set = cells.get("set").copied().unwrap_or_default();
    let set = shlex::split(set)
        .ok_or_else(|| format!("the column `set` is `{set}`, in which a quote is not closed"))?;
    if cells.contains_key("configuration") && is_configuration(path) {
        return Err(format!(
            "`{path}` is a configuration itself, so it has none in the column `configuration`"
        ));
    }
    Ok(Drive {
        configuration: cells.get("configuration").map(|&it| it.to_owned()),
        set,
        ..drive(path, cells.get("name").copied())?
    })
}

/// Returns a drive by its path, named after that without a name of its own.
fn drive(path: &str, name: Option<&str>) -> Result<Drive, String> {
    let of_path = Path::new(path);
    let last = match is_recorded(of_path) || is_configuration(path) {
        true => of_path.file_stem(),
        false => of_path.file_name(),
    };
    let name = name.or(last.and_then(|last| last.to_str()));
    let name =
        name.ok_or_else(|| format!("`{path}` has no name: give one in the column `name`"))?;
    match is_valid(name) {
        true => Ok(Drive {
            name: name.to_owned(),
            path: path.to_owned(),
            configuration: None,
            set: Vec::new(),
        }),
        false => Err(format!(
            "`{name}` cannot be the name of a drive: files are named after it, so it begins with no dot, has no slash and at most \
             {MAX_NAME} bytes; give another one in the column `name`"
        )),
    }
}

fn is_valid(name: &str) -> bool {
    let is_plain = |c: char| c != '/' && !c.is_control();
    !name.is_empty()
        && !name.starts_with('.')
        && name.len() <= MAX_NAME
        && name.chars().all(is_plain)
}

fn require_unique(path: &Path, lines: &[(u64, Drive)]) -> Result<(), BatchError> {
    let mut seen = BTreeMap::new();
    for (line, drive) in lines {
        if let Some(first) = seen.insert(&drive.name, line) {
            let reason = format!(
                "the drive of line {first} is named `{}` too: give them different names in the column `name`",
                drive.name
            );
            return Err(line_error(path, *line)(reason));
        }
    }
    Ok(())
}

fn line_error(path: &Path, line: u64) -> impl Fn(String) -> BatchError {
    let path = path.to_owned();
    move |reason| BatchError::Line {
        path: path.clone(),
        line,
        reason,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn read(text: &str) -> Result<List, BatchError> {
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
        let named = |drive: &Drive| (drive.name.clone(), drive.path.clone());
        let named: Vec<_> = list.drives().iter().map(named).collect();
        let expected = [
            ("a, b", "/data/a, b/"),
            ("c", "runs/c.mcap"),
            ("sim", "sim.toml"),
        ];
        assert_eq!(named, expected.map(|(n, p)| (n.to_owned(), p.to_owned())));
        assert_eq!(list.resolve("/data/x"), Path::new("/data/x"));
        assert!(list.resolve("runs/c.mcap").is_absolute());
    }

    #[test]
    fn columns_name_drives_and_set_keys() {
        let text = "name,drive,set\nfirst, x/radar,raster.n=127 'masking.model=a b'\n# no\n,y,\n";
        let list = read(text).unwrap();
        let [first, second] = list.drives() else {
            panic!("{list:?}")
        };
        assert_eq!(first.name, "first");
        assert_eq!(first.set, ["raster.n=127", "masking.model=a b"]);
        assert_eq!((second.name.as_str(), second.set.len()), ("y", 0));
    }

    #[test]
    fn a_list_that_is_wrong_names_the_line() {
        let twice = refusal("a/radar\n\nb/radar\n");
        assert!(
            twice.starts_with(", line 3: the drive of line 1 is named `radar` too"),
            "{twice}"
        );
        let column = refusal("drive,sett\na,b\n");
        assert!(column.contains("no column `sett`"), "{column}");
        for (text, words) in [
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
        let names: Vec<_> = list.drives().iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["a", "b", "run"]);
        assert!(list.resolve(&list.drives()[0].path).is_dir());
        fs::create_dir(folder.path().join("navtech")).unwrap();
        fs::write(folder.path().join("navtech/1.png"), "").unwrap();
        let refused = List::read(folder.path());
        assert!(matches!(refused, Err(BatchError::Empty { .. })));
    }

    #[test]
    fn tasks_share_the_drives_out() {
        let list = read("a\nb\nc\nd\ne\n").unwrap();
        let mut all: Vec<_> = (0..3)
            .flat_map(|task| list.slice(Slice { task, tasks: 3 }).unwrap())
            .map(|drive| drive.name)
            .collect();
        all.sort();
        assert_eq!(all, ["a", "b", "c", "d", "e"]);
        assert_eq!(list.slice(Slice { task: 7, tasks: 8 }).unwrap(), []);
        let error = list.slice(Slice { task: 3, tasks: 3 }).unwrap_err();
        assert!(error.to_string().contains("the last one is 2"), "{error}");
    }
}
