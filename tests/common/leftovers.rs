//! Asserts that a run leaves nothing but its results. Other runs on the machine do not matter.

use std::{
    fs,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use super::processes;

/// The run's place in shared memory, which is named after its results (`gyre_stage::run::RunRoot`).
pub fn root(out: &Path) -> PathBuf {
    let out = out.canonicalize().unwrap_or_else(|_| out.to_owned());
    let bytes = out.as_os_str().as_encoded_bytes().iter();
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    });
    PathBuf::from(format!("/dev/shm/gyre/gyre{:010x}", hash & 0xff_ffff_ffff))
}

/// Asserts that no process, shared-memory file or temporary file of the run that wrote to `out` is there.
pub fn assert_nothing_left(out: &Path) {
    let root = root(out);
    assert_eq!(
        processes::of_run(&root),
        Vec::<processes::Pid>::new(),
        "processes of {}",
        root.display()
    );
    assert!(
        !root.exists(),
        "{} is still there: {:?}",
        root.display(),
        files_in(&root)
    );
    assert_eq!(shared_memory_of(&root), Vec::<String>::new());
    let transport = std::env::temp_dir().join("iceoryx2");
    assert!(
        !names_below(&transport)
            .iter()
            .any(|path| is_of(path, &root)),
        "in {}",
        transport.display()
    );
}

/// The shared memory of the run that writes to `out`, without bookkeeping.
pub fn bytes(out: &Path) -> u64 {
    let files = shared_memory_of(&root(out)).into_iter();
    files
        .filter_map(|name| {
            Some(
                fs::metadata(Path::new("/dev/shm").join(name))
                    .ok()?
                    .blocks()
                    * 512,
            )
        })
        .sum()
}

/// Removes what a killed run left.
pub fn remove(out: &Path) {
    let root = root(out);
    for name in shared_memory_of(&root) {
        let _ = fs::remove_file(Path::new("/dev/shm").join(name));
    }
    let _ = fs::remove_dir_all(&root);
}

fn shared_memory_of(root: &Path) -> Vec<String> {
    let prefix = format!("{}_", root.file_name().unwrap().to_string_lossy());
    files_in(Path::new("/dev/shm"))
        .into_iter()
        .filter(|name| name.starts_with(&prefix))
        .collect()
}

fn is_of(name: &str, root: &Path) -> bool {
    name.contains(&*root.file_name().unwrap().to_string_lossy())
}

fn files_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect()
}

fn names_below(folder: &Path) -> Vec<String> {
    let below = |name: String| {
        let deeper = names_below(&folder.join(&name));
        std::iter::once(name).chain(deeper)
    };
    files_in(folder).into_iter().flat_map(below).collect()
}
