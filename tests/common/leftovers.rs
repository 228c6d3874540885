//! Asserts that a run leaves nothing but its results. Other runs on the machine do not matter.

use std::{
    fs,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use gyre_transport::run::{SHARED_MEMORY, root_of};

use super::{names_in, processes};

/// The run's place in shared memory, which is named after its results.
pub fn root(out: &Path) -> PathBuf {
    root_of(&out.canonicalize().unwrap_or_else(|_| out.to_owned()))
}

/// Asserts that no process, shared-memory file or temporary file of the run that wrote to `out` is
/// there.
pub fn assert_nothing_left(out: &Path) {
    assert_nothing_left_of(&root(out));
}

/// The same of the run with this root.
pub fn assert_nothing_left_of(root: &Path) {
    assert_eq!(
        processes::of_run(root),
        Vec::<processes::Pid>::new(),
        "processes of {}",
        root.display()
    );
    assert!(
        !root.exists(),
        "{} is still there: {:?}",
        root.display(),
        names_in(root)
    );
    let lock = root.with_extension("lock");
    assert!(!lock.exists(), "{} is still there", lock.display());
    assert_eq!(shared_memory_of(root), Vec::<String>::new());
    let transport = std::env::temp_dir().join("iceoryx2");
    assert!(
        !names_below(&transport).iter().any(|path| is_of(path, root)),
        "in {}",
        transport.display()
    );
}

/// The shared memory of the run that writes to `out`, without bookkeeping.
pub fn bytes(out: &Path) -> u64 {
    let files = shared_memory(out).into_iter();
    files
        .filter_map(|file| Some(fs::metadata(file).ok()?.blocks() * 512))
        .sum()
}

/// The files in shared memory of the run that writes to `out`, without bookkeeping.
pub fn shared_memory(out: &Path) -> Vec<PathBuf> {
    let names = shared_memory_of(&root(out)).into_iter();
    names
        .map(|name| Path::new(SHARED_MEMORY).join(name))
        .collect()
}

pub fn remove(out: &Path) {
    for file in shared_memory(out) {
        let _ = fs::remove_file(file);
    }
    let root = root(out);
    let _ = fs::remove_dir_all(&root);
    let _ = fs::remove_file(root.with_extension("lock"));
}

fn shared_memory_of(root: &Path) -> Vec<String> {
    let prefix = format!("{}_", root.file_name().unwrap().to_string_lossy());
    names_in(Path::new(SHARED_MEMORY))
        .into_iter()
        .filter(|name| name.starts_with(&prefix))
        .collect()
}

fn is_of(name: &str, root: &Path) -> bool {
    name.contains(&*root.file_name().unwrap().to_string_lossy())
}

fn names_below(folder: &Path) -> Vec<String> {
    let below = |name: String| {
        let deeper = names_below(&folder.join(&name));
        std::iter::once(name).chain(deeper)
    };
    names_in(folder).into_iter().flat_map(below).collect()
}
