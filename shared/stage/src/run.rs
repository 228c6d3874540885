//! A run: its name, its files, and the manifest that each of its processes reads.
//!
//! The root of a run is on tmpfs (`/dev/shm/gyre/<name>`), where the transport's bookkeeping makes recovery four times faster
//! than on a disk. It holds the manifest, the resolved configuration and the transport's sockets, and is removed at the end.

use std::{
    fs::{self, File, Permissions},
    io::ErrorKind,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use gyre_messages::{Limits, Window};
use iceoryx2::prelude::{Config, FileName, Path as TransportPath, SemanticString};
use rustix::fs::{FlockOperation, flock};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::StageError;

/// The environment variable with the path of the run's root.
pub const ENVIRONMENT: &str = "GYRE_RUN";
const RUNS: &str = "/dev/shm/gyre";
const SHARED_MEMORY: &str = "/dev/shm";
/// All users may create runs, but only remove their own.
const STICKY_FOR_ALL: u32 = 0o1777;
const OWNER_ONLY: u32 = 0o700;

/// The properties of a run that its processes need.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Manifest {
    /// Prefix of all names of the run in shared memory.
    pub prefix: String,
    /// The root of the run.
    pub root: PathBuf,
    /// The folder of the results.
    pub out: PathBuf,
    /// The window of scans in flight.
    pub window: Window,
    /// Sizes of the largest messages.
    pub limits: Limits,
    /// True in live mode, which drops old scans; false in lossless mode, which processes every scan.
    pub live: bool,
    /// True if the run has a refinement: poses are then composed of `refined`, else of `motion`.
    pub refines: bool,
    /// Speed of playback relative to the sensor's clock; `None`: as fast as the window admits scans.
    pub rate: Option<f64>,
}

impl Manifest {
    /// Reads the manifest of the run at `root`.
    ///
    /// # Errors
    /// A file that is missing or invalid.
    pub fn read(root: &Path) -> Result<Self, StageError> {
        let path = root.join("manifest.json");
        let failed = |reason: String| StageError::Manifest {
            path: path.clone(),
            reason,
        };
        let text = fs::read_to_string(&path).map_err(|error| failed(error.to_string()))?;
        serde_json::from_str(&text).map_err(|error| failed(error.to_string()))
    }

    /// Writes the manifest, the resolved configuration and the configuration of the transport into the run's root.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, configuration: &str) -> Result<(), StageError> {
        let transport = format!(
            "[global]\nroot-path = \"{}/\"\nprefix = \"{}\"\n\n\
             [global.node]\ncleanup-dead-nodes-on-creation = false\ncleanup-dead-nodes-on-destruction = false\n\n\
             [global.service]\ncleanup-dead-nodes-on-open = false\n",
            self.root.display(),
            self.prefix
        );
        let manifest = serde_json::to_string_pretty(self).map_err(|error| {
            StageError::Configuration(format!("cannot write the run's manifest: {error}"))
        })?;
        for (name, text) in [
            ("manifest.json", manifest.as_str()),
            ("config.toml", configuration),
            ("iox.toml", &transport),
        ] {
            let path = self.root.join(name);
            fs::write(&path, text).map_err(|source| StageError::File { path, source })?;
        }
        Ok(())
    }

    /// Returns the configuration of the transport. Names and paths are unique to the run, and only the supervisor cleans up.
    pub(crate) fn transport(&self) -> Result<Config, StageError> {
        let mut config = Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes())
            .map_err(|e| StageError::transport("name the run", e))?;
        let root = format!("{}/", self.root.display());
        let root = TransportPath::new(root.as_bytes())
            .map_err(|e| StageError::transport("use the run's root", e))?;
        config.global.set_root_path(&root);
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(config)
    }
}

/// The root of a run in shared memory, locked by its supervisor. Dropping it removes all files of the run.
#[derive(Debug)]
pub struct RunRoot {
    name: String,
    path: PathBuf,
    _lock: File,
}

/// An error in creating the root of a run.
#[derive(Debug, Error)]
pub enum RootError {
    /// Another run writes to the same results.
    #[error("another run is writing to {0}: wait for it, or choose another --out")]
    Busy(PathBuf),
    /// Shared memory cannot be used.
    #[error(
        "cannot use {path} for the run's shared memory: {source}; Gyre needs a writable tmpfs at /dev/shm"
    )]
    Unusable {
        /// The path.
        path: PathBuf,
        /// The system error.
        source: std::io::Error,
    },
}

impl RunRoot {
    /// Creates and locks the root of the run that writes to `out`, after removing the files of dead runs.
    ///
    /// # Errors
    /// Another run writes to `out`, or shared memory cannot be used.
    pub fn acquire(out: &Path) -> Result<Self, RootError> {
        let name = format!(
            "gyre{:010x}",
            hash(out.as_os_str().as_encoded_bytes()) & 0xff_ffff_ffff
        );
        let path = Path::new(RUNS).join(&name);
        let unusable = |source| RootError::Unusable {
            path: path.clone(),
            source,
        };
        let _exclusive = lock_all_runs().map_err(unusable)?;
        remove_dead_runs();
        make_directory(Path::new(RUNS), STICKY_FOR_ALL).map_err(unusable)?;
        make_directory(&path, OWNER_ONLY).map_err(unusable)?;
        match try_lock(&path).map_err(unusable)? {
            Some(lock) => Ok(Self {
                name,
                path,
                _lock: lock,
            }),
            None => Err(RootError::Busy(out.to_owned())),
        }
    }

    /// Returns the prefix of all names of the run in shared memory.
    pub fn prefix(&self) -> String {
        format!("{}_", self.name)
    }

    /// Returns the path of the root.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for RunRoot {
    fn drop(&mut self) {
        let _exclusive = lock_all_runs();
        remove_run(&self.name);
    }
}

/// Creates a directory with exactly these permissions unless it exists.
fn make_directory(path: &Path, mode: u32) -> std::io::Result<()> {
    match fs::create_dir(path) {
        Ok(()) => fs::set_permissions(path, Permissions::from_mode(mode)),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(()),
        Err(error) => Err(error),
    }
}

fn try_lock(root: &Path) -> std::io::Result<Option<File>> {
    let file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(root.join("owner.lock"))?;
    match flock(&file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(Some(file)),
        Err(rustix::io::Errno::WOULDBLOCK) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Lets one supervisor at a time create and remove runs. Otherwise a run that is being created, and is not locked yet, could be
/// taken for dead.
fn lock_all_runs() -> std::io::Result<File> {
    let directory = File::open(SHARED_MEMORY)?;
    flock(&directory, FlockOperation::LockExclusive)?;
    Ok(directory)
}

/// Removes runs whose supervisor was killed: their locks are free.
fn remove_dead_runs() {
    let Ok(runs) = fs::read_dir(RUNS) else { return };
    for run in runs.flatten() {
        if matches!(try_lock(&run.path()), Ok(Some(_))) {
            remove_run(&run.file_name().to_string_lossy());
        }
    }
}

fn remove_run(name: &str) {
    if let Ok(files) = fs::read_dir(SHARED_MEMORY) {
        let prefix = format!("{name}_");
        let ours = files
            .flatten()
            .filter(|file| file.file_name().to_string_lossy().starts_with(&prefix));
        ours.for_each(|file| drop(fs::remove_file(file.path())));
    }
    let _ = fs::remove_dir_all(Path::new(RUNS).join(name));
    // Fails while there is another run.
    let _ = fs::remove_dir(RUNS);
}

/// The FNV-1a hash, which names a run after its results independently of the build.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_run_locks_its_root_and_removes_all_files() {
        let out = tempfile::tempdir().unwrap();
        let root = RunRoot::acquire(out.path()).unwrap();
        assert!(matches!(
            RunRoot::acquire(out.path()),
            Err(RootError::Busy(_))
        ));
        let segment = Path::new(SHARED_MEMORY).join(format!("{}leftover", root.prefix()));
        fs::write(&segment, b"").unwrap();
        let path = root.path().to_owned();
        drop(root);
        assert!(!segment.exists() && !path.exists());
        assert!(RunRoot::acquire(out.path()).is_ok());
    }
}
