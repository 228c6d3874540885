//! A disk whose power fails: its possible contents after recorded changes, by their
//! synchronisation.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use gyre_storage::record::Operation;
use rand::{Rng, rngs::StdRng};

/// A disk writes whole sectors, and any of them first.
const SECTOR: usize = 512;

/// The safe content of a file, and its unsafe changes, oldest first.
#[derive(Clone, Default)]
struct File {
    safe: Vec<u8>,
    in_danger: Vec<(usize, Change)>,
}

#[derive(Clone)]
enum Change {
    Write { offset: usize, bytes: Vec<u8> },
    SetLength(usize),
}

/// A change of names in a folder: a name, and the file that it has from then on.
#[derive(Clone)]
struct Naming {
    folder: PathBuf,
    names: Vec<(PathBuf, Option<usize>)>,
}

/// The part of the changes in danger that survives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Survives {
    Nothing,
    All,
    /// Any part of them, each sector and each name by chance.
    Some,
}

#[derive(Default)]
pub struct Disk {
    files: Vec<File>,
    safe_names: BTreeMap<PathBuf, usize>,
    names: BTreeMap<PathBuf, usize>,
    namings: Vec<Naming>,
    syncs: BTreeMap<u64, usize>,
    folders: BTreeSet<PathBuf>,
    time: usize,
}

/// The content of a disk after a power failure: folders, and files with their bytes.
#[derive(PartialEq, Eq, Hash)]
pub struct State {
    folders: BTreeSet<PathBuf>,
    files: BTreeMap<PathBuf, Vec<u8>>,
}

impl State {
    pub fn write(&self, to: &Path) {
        for folder in &self.folders {
            fs::create_dir_all(to.join(folder)).unwrap();
        }
        for (name, content) in &self.files {
            fs::write(to.join(name), content).unwrap();
        }
    }
}

impl Disk {
    /// A disk with the content of a folder, all of it safe.
    pub fn of(folder: &Path) -> Self {
        let mut disk = Self::default();
        let mut folders = vec![folder.to_owned()];
        while let Some(next) = folders.pop() {
            for entry in fs::read_dir(&next).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                disk.names.insert(path.clone(), disk.files.len());
                disk.files.push(File {
                    safe: fs::read(&path).unwrap(),
                    in_danger: Vec::new(),
                });
            }
            disk.folders.insert(next);
        }
        disk.safe_names = disk.names.clone();
        disk
    }

    pub fn apply(&mut self, operation: &Operation) {
        self.time += 1;
        match operation {
            Operation::CreateFolder(path) => _ = self.folders.insert(path.clone()),
            Operation::Create(path) => {
                self.files.push(File::default());
                self.rename(vec![(path.clone(), Some(self.files.len() - 1))]);
            }
            Operation::Rename { from, to } => {
                self.rename_all(from, to);
            }
            Operation::Remove(path) => self.rename(vec![(path.clone(), None)]),
            Operation::Write {
                path,
                offset,
                bytes,
            } => self.change(
                path,
                Change::Write {
                    offset: *offset as usize,
                    bytes: bytes.clone(),
                },
            ),
            Operation::SetLength { path, length } => {
                self.change(path, Change::SetLength(*length as usize));
            }
            Operation::SyncBegins { id, .. } => _ = self.syncs.insert(*id, self.time),
            Operation::SyncEnds { path, id } => self.sync(path, self.syncs[id]),
            Operation::SyncFolder(folder) => self.sync_folder(folder),
        }
    }

    /// Renames a file, or a folder with all files in it.
    fn rename_all(&mut self, from: &Path, to: &Path) {
        if self.folders.contains(from) {
            self.folders.insert(to.to_owned());
        }
        let moved = self.names.iter().filter_map(|(name, file)| {
            let rest = name.strip_prefix(from).ok()?;
            let new = match rest.as_os_str().is_empty() {
                true => to.to_owned(),
                false => to.join(rest),
            };
            Some([(name.clone(), None), (new, Some(*file))])
        });
        let names: Vec<_> = moved.flatten().collect();
        let folder = from.parent().unwrap().to_owned();
        apply_names(&mut self.names, &names);
        self.namings.push(Naming { folder, names });
    }

    fn rename(&mut self, names: Vec<(PathBuf, Option<usize>)>) {
        apply_names(&mut self.names, &names);
        let folder = names[0].0.parent().unwrap().to_owned();
        self.namings.push(Naming { folder, names });
    }

    fn change(&mut self, path: &Path, change: Change) {
        let file = self.names[path];
        self.files[file].in_danger.push((self.time, change));
    }

    fn sync(&mut self, path: &Path, begun: usize) {
        // A draft that has been renamed or removed meanwhile is synchronised before that.
        let Some(file) = self.names.get(path).map(|file| &mut self.files[*file]) else {
            return;
        };
        let (covered, later): (Vec<_>, Vec<_>) = file
            .in_danger
            .drain(..)
            .partition(|(time, _)| *time < begun);
        covered
            .iter()
            .for_each(|(_, change)| change.apply(&mut file.safe));
        file.in_danger = later;
    }

    fn sync_folder(&mut self, folder: &Path) {
        let (covered, others): (Vec<_>, Vec<_>) = self
            .namings
            .drain(..)
            .partition(|naming| naming.folder == folder);
        for naming in covered {
            apply_names(&mut self.safe_names, &naming.names);
        }
        self.namings = others;
    }

    /// Returns the content of the disk after a power failure. Names in it are relative to `root`.
    pub fn fail(&self, survives: Survives, random: &mut StdRng, root: &Path) -> State {
        let mut kept = |share: f64| match survives {
            Survives::Nothing => false,
            Survives::All => true,
            Survives::Some => random.random_bool(share),
        };
        let mut names = self.safe_names.clone();
        for naming in &self.namings {
            if kept(0.5) {
                apply_names(&mut names, &naming.names);
            }
        }
        let relative = |path: &Path| path.strip_prefix(root).unwrap().to_owned();
        let mut content = |file: &File| {
            let mut content = file.safe.clone();
            for (_, change) in &file.in_danger {
                change.apply_in_part(&mut content, &mut kept);
            }
            content
        };
        State {
            folders: self.folders.iter().map(|it| relative(it)).collect(),
            files: names
                .iter()
                .map(|(name, file)| (relative(name), content(&self.files[*file])))
                .collect(),
        }
    }
}

fn apply_names(names: &mut BTreeMap<PathBuf, usize>, changes: &[(PathBuf, Option<usize>)]) {
    for (name, file) in changes {
        match file {
            Some(file) => _ = names.insert(name.clone(), *file),
            None => _ = names.remove(name),
        }
    }
}

impl Change {
    fn apply(&self, content: &mut Vec<u8>) {
        self.apply_in_part(content, &mut |_| true);
    }

    fn apply_in_part(&self, content: &mut Vec<u8>, kept: &mut impl FnMut(f64) -> bool) {
        match self {
            Self::SetLength(length) => {
                if kept(0.5) {
                    content.resize(*length, 0);
                }
            }
            Self::Write { offset, bytes } => {
                // Most writes survive or fall as a whole; the others are torn between sectors.
                if kept(0.6) {
                    return write(content, *offset, bytes);
                }
                let mut from = 0;
                while from < bytes.len() {
                    let sector_end = SECTOR - (offset + from) % SECTOR;
                    let end = bytes.len().min(from + sector_end);
                    if kept(0.3) {
                        write(content, offset + from, &bytes[from..end]);
                    }
                    from = end;
                }
            }
        }
    }
}

fn write(content: &mut Vec<u8>, offset: usize, bytes: &[u8]) {
    let end = offset + bytes.len();
    if content.len() < end {
        content.resize(end, 0);
    }
    content[offset..end].copy_from_slice(bytes);
}
