//! The files of a recording: FILE.mcap, and FILE.2.mcap, FILE.3.mcap and so on, which are begun
//! when the one before is large or long enough, and by recorders that were restarted. Those that
//! are complete may be moved away: no number is given twice.

use std::{
    collections::BTreeSet,
    fs, io,
    path::{self, Path, PathBuf},
    time::Duration,
};

use bytemuck::pod_read_unaligned;
use gyre_contract::Item;
use gyre_storage::SETTINGS;
use serde::{Deserialize, Serialize};

use crate::{
    Entry, Head, Incoming, Positions, RecordingError, RecordingWriter,
    head::{head, newest},
};

/// Returns the path of a part, from 1.
pub(crate) fn part(path: &Path, number: usize) -> PathBuf {
    match number {
        1 => path.to_owned(),
        _ => path.with_extension(format!("{number}.mcap")),
    }
}

/// Returns the files of a recording that exist, in order. It is named by its first file, which need
/// not exist any more, or by a folder that holds it and no other one.
pub fn parts(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() {
        return first_part_in(path).map_or_else(Vec::new, |first| parts(&first));
    }
    let parts = numbers(path).into_iter().filter_map(|number| {
        let path = part(path, number);
        (number == 1 || is_part(&path, number)).then_some(path)
    });
    parts.collect()
}

/// Returns whether a file is this part of a recording, not a different file with a number in its
/// name.
fn is_part(path: &Path, number: usize) -> bool {
    head(path).is_some_and(|head| head.part == number)
}

fn numbers(path: &Path) -> Vec<usize> {
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    let Ok(files) = fs::read_dir(folder.unwrap_or(Path::new("."))) else {
        // It may be searched all the same.
        let exists = |number: &usize| part(path, *number).exists();
        return (1..).take_while(exists).collect();
    };
    let files = files.flatten().map(|file| file.path());
    let later = files.filter_map(|file| {
        let (first, number) = later_part(&file)?;
        (first.file_name() == path.file_name()).then_some(number)
    });
    let first = path.exists().then_some(1);
    let mut numbers: Vec<usize> = later.chain(first).collect();
    numbers.sort_unstable();
    numbers
}

/// Returns the first file of the only recording in a folder.
pub(crate) fn first_part_in(folder: &Path) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.flatten();
    let files = files.map(|file| file.path()).filter(|path| {
        let name = path.file_name().unwrap_or_default().as_encoded_bytes();
        // macOS stores `._NAME.mcap` beside NAME.mcap on file systems of others.
        path.extension().is_some_and(|it| it == "mcap") && !name.starts_with(b".")
    });
    let first = files.map(|path| match later_part(&path) {
        Some((first, number)) if is_part(&path, number) => first,
        _ => path,
    });
    let mut first: BTreeSet<PathBuf> = first.collect();
    let only = first.pop_first();
    only.filter(|_| first.is_empty())
}

/// Returns the first file and the number of NAME.N.mcap.
fn later_part(path: &Path) -> Option<(PathBuf, usize)> {
    let name = path.file_name()?.to_str()?.strip_suffix(".mcap")?;
    let (name, digits) = name.rsplit_once('.')?;
    let number = digits.parse().ok().filter(|number| *number > 1)?;
    // Not `007`, which no recorder writes.
    let first = path.with_file_name(format!("{name}.mcap"));
    (part(&first, number) == path).then_some((first, number))
}

/// Returns the number of the next part: after those that exist, and after this one.
pub fn next_part(path: &Path, after: usize) -> usize {
    numbers(path).last().map_or(after, |last| after.max(*last)) + 1
}

/// When a file is ended. The limits are checked before each message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// The size, bytes; `None`: any. A file is larger by at most a chunk and its summary.
    pub bytes: Option<u64>,
    /// Time from its first to its newest scan on the sensor's clock, ns; `None`: any.
    pub span_ns: Option<i64>,
    /// The size of all files, and the age of the oldest one: older files are removed; `None`: any.
    pub keep_bytes: Option<u64>,
    pub keep_age: Option<Duration>,
}

pub struct SplitWriter {
    /// The first part.
    to: PathBuf,
    head: Head,
    split: Split,
    /// The part that is being written, for records that are not messages.
    pub file: RecordingWriter,
    /// Stores the parts; `None` for a recording that nobody continues.
    ledger: Option<Ledger>,
    /// The positions behind all that was added.
    positions: Positions,
}

impl SplitWriter {
    /// Begins the part of the recording `to` given by `head`, behind `positions`.
    pub fn create(
        to: PathBuf,
        head: Head,
        split: Split,
        ledger: Option<Ledger>,
        positions: Positions,
    ) -> Result<Self, RecordingError> {
        if let Some(ledger) = &ledger {
            ledger.note(&to, &head, &positions)?;
        }
        Ok(Self {
            file: RecordingWriter::create(&part(&to, head.part), &head)?,
            to,
            head,
            split,
            ledger,
            positions,
        })
    }

    /// Adds a message, to the next part if this one is full.
    pub fn add(&mut self, message: &Incoming) -> Result<(), RecordingError> {
        let Split { bytes, span_ns, .. } = self.split;
        let is_full = bytes.is_some_and(|bytes| self.file.bytes() >= bytes)
            || span_ns.is_some_and(|span_ns| self.file.span_ns() >= span_ns);
        if is_full {
            self.go_on()?;
        }
        self.file.add(message)?;
        if let Some(item) = message.header.get(..size_of::<Item>()) {
            let position = self.positions.entry(message.topic.to_owned()).or_default();
            position.pass(&Entry::of(&pod_read_unaligned(item)));
        }
        Ok(())
    }

    /// Ends the file and begins the next one. The ledger has no message that is not written, and
    /// each number before there is a file of it.
    fn go_on(&mut self) -> Result<(), RecordingError> {
        self.file.end()?;
        self.head.part = next_part(&self.to, self.head.part);
        if let Some(ledger) = &self.ledger {
            ledger.note(&self.to, &self.head, &self.positions)?;
        }
        let next = part(&self.to, self.head.part);
        let ended = self.file.path.clone();
        self.file.go_on(&next, &self.head)?;
        self.remove_old(&ended)
    }

    /// Removes the oldest files, as if the file that is begun were as large as the one that has
    /// ended.
    fn remove_old(&self, ended: &Path) -> Result<(), RecordingError> {
        let Split {
            keep_bytes,
            keep_age,
            ..
        } = self.split;
        if keep_bytes.is_none() && keep_age.is_none() {
            return Ok(());
        }
        let mut bytes = fs::metadata(ended).map_or(0, |it| it.len());
        let older = parts(&self.to).into_iter().rev();
        for path in older.filter(|it| *it != self.file.path) {
            let file = fs::metadata(&path).map_err(|error| RecordingError::io(&path, error))?;
            bytes += file.len();
            let age = file.modified().ok().and_then(|it| it.elapsed().ok());
            let is_old = keep_age.zip(age).is_some_and(|(keep, age)| age > keep);
            let is_own = head(&path).is_some_and(|head| head.id == self.head.id);
            if is_own && (is_old || keep_bytes.is_some_and(|keep| bytes > keep)) {
                gyre_storage::remove(&path).map_err(|it| RecordingError::io(&path, it.source))?;
            }
        }
        Ok(())
    }
}

/// The newest part of a recording, and what all parts before it hold.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Begun {
    to: PathBuf,
    pub id: String,
    pub part: usize,
    /// The positions behind the parts before it.
    pub positions: Positions,
}

/// The ledger of a recording: the information for the next recorder of its run, even if the earlier
/// parts have been moved away. It is kept with the journal of the run, and read instead of the
/// parts.
#[derive(Clone, Debug)]
pub struct Ledger(PathBuf);

impl Ledger {
    pub fn of(out: &Path) -> Self {
        Self(out.join("journal").join("recording.toml"))
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Reads the ledger of an earlier recorder that writes to `to`, with the positions behind its
    /// newest part. Unreadable content of a part counts as missed.
    pub fn read(&self, to: &Path) -> Result<Option<Begun>, RecordingError> {
        let text = match gyre_storage::read_text(&self.0, SETTINGS) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            read => read.map_err(|source| self.failed(source))?,
        };
        let mut begun: Begun = toml::from_str(&text)
            .map_err(|error| self.failed(io::Error::other(error.message().to_owned())))?;
        let is_of_it = |path: PathBuf| head(&path).is_some_and(|head| head.id == begun.id);
        // Under another name too: on a disk that is mounted elsewhere, by a link.
        if begun.to != self.absolute(to)? && !parts(to).into_iter().any(is_of_it) {
            return Ok(None);
        }
        if let Ok((head, passed)) = newest(&part(to, begun.part))
            && head.id == begun.id
        {
            for (topic, position) in passed {
                let known = begun.positions.entry(topic).or_default();
                if (position.generation, position.next) > (known.generation, known.next) {
                    *known = position;
                }
            }
        }
        Ok(Some(begun))
    }

    /// Notes that a part is begun. The note survives a power failure.
    fn note(&self, to: &Path, head: &Head, positions: &Positions) -> Result<(), RecordingError> {
        let begun = Begun {
            to: self.absolute(to)?,
            id: head.id.clone(),
            part: head.part,
            positions: positions.clone(),
        };
        let text = toml::to_string(&begun).map_err(|error| self.failed(io::Error::other(error)))?;
        let folder = self.0.parent().map_or(Ok(()), gyre_storage::create_folder);
        let written = folder.and_then(|()| gyre_storage::write(&self.0, text));
        written.map_err(|error| self.failed(error.source))
    }

    /// Returns the absolute path, so that the run may restart in any folder.
    fn absolute(&self, to: &Path) -> Result<PathBuf, RecordingError> {
        path::absolute(to).map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> RecordingError {
        RecordingError::io(&self.0, source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes a part without messages.
    fn write(path: &Path, number: usize) {
        let head = Head {
            id: "a".to_owned(),
            part: number,
            ..Head::default()
        };
        let writer = RecordingWriter::create(path, &head).unwrap();
        writer.finish().unwrap();
    }

    #[test]
    fn a_recording_goes_on_behind_all_parts_that_were_ever_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.b.mcap");
        assert_eq!(next_part(&path, 0), 1);
        write(&path, 1);
        let second = folder.path().join("a.b.2.mcap");
        assert_eq!(next_part(&path, 1), 2);
        write(&second, 2);
        assert_eq!(parts(&path), [path.clone(), second.clone()]);
        assert_eq!(next_part(&path, 1), 3);
        fs::write(folder.path().join("._a.b.mcap"), "Mac OS X").unwrap();
        assert_eq!(parts(folder.path()), parts(&path), "a folder of one");
        let tenth = folder.path().join("a.b.10.mcap");
        write(&tenth, 10);
        fs::remove_file(&path).unwrap();
        assert_eq!(parts(&path), [second.clone(), tenth.clone()]);
        assert_eq!(parts(folder.path()), parts(&path), "the first was moved");
        assert_eq!(next_part(&path, 2), 11);
        fs::remove_file(&tenth).unwrap();
        fs::remove_file(&second).unwrap();
        assert_eq!(next_part(&path, 10), 11, "all were moved");
        write(&folder.path().join("a.mcap"), 1);
        write(&folder.path().join("b.mcap"), 1);
        assert!(parts(folder.path()).is_empty(), "a folder of two");
    }

    #[test]
    fn a_number_in_the_name_of_another_file_makes_it_no_part() {
        let folder = tempfile::tempdir().unwrap();
        let [day, second, next] = ["2024.11.26.mcap", "2024.11.26.2.mcap", "2024.11.27.mcap"]
            .map(|name| folder.path().join(name));
        write(&day, 1);
        write(&second, 2);
        assert_eq!(parts(folder.path()), [day.clone(), second.clone()]);
        write(&next, 1);
        assert!(parts(folder.path()).is_empty(), "two drives");
        let drive = folder.path().join("2024.mcap");
        fs::write(folder.path().join("2024.11.mcap"), "a bag").unwrap();
        assert!(parts(&drive).is_empty(), "nothing of that name");
        write(&drive, 1);
        assert_eq!(parts(&drive), [drive]);
    }

    #[test]
    fn only_the_names_that_recorders_give_are_of_later_parts() {
        let number = |name: &str| later_part(Path::new(name)).map(|(_, number)| number);
        assert_eq!(number("x/a.2.mcap"), Some(2));
        for other in ["a.mcap", "a.1.mcap", "a.02.mcap", "a.b.mcap", "a.2.bag"] {
            assert_eq!(number(other), None, "{other}");
        }
    }
}
