//! A run: its name, its files, and what each of its processes must know.
//!
//! The run's root lies on tmpfs (`/dev/shm/gyre/<name>`): the transport's bookkeeping there makes recovery four times
//! faster than on a disk. It holds the manifest, the resolved configuration and the transport's sockets, and goes with the run.

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

/// The environment variable that leads a stage to its run: the path of the run's root.
pub const ENVIRONMENT: &str = "GYRE_RUN";
const RUNS: &str = "/dev/shm/gyre";
const SHARED_MEMORY: &str = "/dev/shm";
/// Anybody's runs may be in it, and nobody removes another's.
const FOR_ALL_USERS: u32 = 0o1777;
const FOR_THE_OWNER: u32 = 0o700;

/// What a process must know of its run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Manifest {
    /// Prefix of all the run's names in shared memory.
    pub prefix: String,
    /// The run's root.
    pub root: PathBuf,
    /// Where the results go.
    pub out: PathBuf,
    /// How much may be on its way.
    pub window: Window,
    /// The largest messages.
    pub limits: Limits,
    /// Whether the newest scan wins; else every scan is processed.
    pub live: bool,
    /// Whether the run has a refinement: then poses are made of `refined`, else of `motion`.
    pub refines: bool,
    /// How fast to play a recording: scans' own time divided by this; `None`: as fast as they are asked for.
    pub rate: Option<f64>,
}

impl Manifest {
    /// Reads the manifest of the run at `root`.
    pub fn read(root: &Path) -> Result<Self, StageError> {
        let path = root.join("manifest.json");
        let failed = |reason: String| StageError::Manifest {
            path: path.clone(),
            reason,
        };
        let text = fs::read_to_string(&path).map_err(|error| failed(error.to_string()))?;
        serde_json::from_str(&text).map_err(|error| failed(error.to_string()))
    }

    /// Writes the manifest, the resolved configuration and the transport's own configuration into the run's root.
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

    /// The transport's configuration: names and paths of this run alone, and nobody but the supervisor cleans up.
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

/// A run's place in shared memory, held by a lock as long as its supervisor lives. Dropping it removes all that the run left.
#[derive(Debug)]
pub struct RunRoot {
    name: String,
    path: PathBuf,
    _lock: File,
}

/// Why a run cannot have its place.
#[derive(Debug, Error)]
pub enum RootError {
    /// Another supervisor works on the same results.
    #[error("another run is writing to {0}: wait for it, or choose another --out")]
    Busy(PathBuf),
    /// Shared memory cannot be used.
    #[error(
        "cannot use {path} for the run's shared memory: {source}; Gyre needs a writable tmpfs at /dev/shm"
    )]
    Unusable {
        /// Which path.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
}

impl RunRoot {
    /// Takes the place of the run that writes to `out`; removes first what dead runs left.
    pub fn take(out: &Path) -> Result<Self, RootError> {
        let name = format!(
            "gyre{:010x}",
            hash(out.as_os_str().as_encoded_bytes()) & 0xff_ffff_ffff
        );
        let path = Path::new(RUNS).join(&name);
        let unusable = |source| RootError::Unusable {
            path: path.clone(),
            source,
        };
        let _alone = lock_all_runs().map_err(unusable)?;
        sweep_dead_runs();
        make_directory(Path::new(RUNS), FOR_ALL_USERS).map_err(unusable)?;
        make_directory(&path, FOR_THE_OWNER).map_err(unusable)?;
        match try_lock(&path).map_err(unusable)? {
            Some(lock) => Ok(Self {
                name,
                path,
                _lock: lock,
            }),
            None => Err(RootError::Busy(out.to_owned())),
        }
    }

    /// Prefix of the run's names in shared memory.
    pub fn prefix(&self) -> String {
        format!("{}_", self.name)
    }

    /// The run's root.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for RunRoot {
    fn drop(&mut self) {
        let _alone = lock_all_runs();
        remove_run(&self.name);
    }
}

/// Makes a directory, if it is not there yet, with just these permissions.
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

/// One supervisor at a time makes and removes runs, for some milliseconds: else one that is just being made, and has no owner
/// yet, could be taken for dead.
fn lock_all_runs() -> std::io::Result<File> {
    let place = File::open(SHARED_MEMORY)?;
    flock(&place, FlockOperation::LockExclusive)?;
    Ok(place)
}

/// Removes what runs left whose supervisor was killed: their locks are free.
fn sweep_dead_runs() {
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
    // Gone with the last run; stays while another one is there.
    let _ = fs::remove_dir(RUNS);
}

/// FNV-1a: the same name for the same results every time, whatever the build.
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
    fn a_run_has_its_place_alone_and_leaves_nothing() {
        let out = tempfile::tempdir().unwrap();
        let root = RunRoot::take(out.path()).unwrap();
        assert!(matches!(RunRoot::take(out.path()), Err(RootError::Busy(_))));
        let segment = Path::new(SHARED_MEMORY).join(format!("{}left_over", root.prefix()));
        fs::write(&segment, b"").unwrap();
        let path = root.path().to_owned();
        drop(root);
        assert!(!segment.exists() && !path.exists());
        assert!(RunRoot::take(out.path()).is_ok());
    }
}
