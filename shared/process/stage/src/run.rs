//! A run: its name, its files, and the manifest that each of its processes reads.
//!
//! The root of a run is on tmpfs (`/dev/shm/gyre-<uid>/<name>`), where the transport's bookkeeping
//! makes recovery four times faster than on a disk. It holds the manifest, the resolved
//! configuration and the transport's sockets, and is removed at the end.

mod root;

use std::{
    fs::{self, OpenOptions},
    io::Write,
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
};

use gyre_messages::{Limits, Window};
use rustix::{
    fs::Mode,
    io::Errno,
    process::{Pid, Signal, getppid, set_parent_process_death_signal, umask},
};
use serde::{Deserialize, Serialize};

use crate::{StageError, transport::Transport};

pub use root::{
    RootError, RunRoot, SHARED_MEMORY, close_to_others, free_shared_memory, own_files, root_of,
    sweep,
};
pub(crate) use root::{is_alive, roots, shared_memory_is_full};

/// The environment variable with the path of the run's root.
pub const ENVIRONMENT: &str = "GYRE_RUN";

/// The environment variable of a process that stands by for another one. When it has loaded what it
/// needs it creates the file `NAME.ready` in the run's root, and it opens its topics when its
/// standard input ends.
pub const STANDBY: &str = "GYRE_STANDBY";

/// Returns the path of the file by which a process says that it stands by.
pub fn ready_file(root: &Path, process: &str) -> PathBuf {
    root.join(format!("{process}.ready"))
}

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
    /// True in live mode, which drops old scans; false in lossless mode, which processes every
    /// scan.
    pub live: bool,
    /// True if the run has a refinement: poses are then composed of `refined`, else of `motion`.
    pub refines: bool,
    /// Speed of playback relative to the sensor's clock; `None`: as fast as the window admits
    /// scans.
    pub rate: Option<f64>,
    /// SHA-256 of the supervisor's program, which all stages of its own must be.
    pub build: String,
}

impl Manifest {
    /// Reads the manifest of the run at `root`.
    ///
    /// # Errors
    /// A file that is missing or invalid.
    pub fn read(root: &Path) -> Result<Self, StageError> {
        let path = Self::path(root);
        let failed = |reason: String| StageError::Manifest {
            path: path.clone(),
            reason,
        };
        let text = fs::read_to_string(&path).map_err(|error| failed(error.to_string()))?;
        serde_json::from_str(&text).map_err(|error| failed(error.to_string()))
    }

    /// Returns the log to which all processes append their events.
    pub fn events(&self) -> PathBuf {
        self.out.join("log.jsonl")
    }

    pub(crate) fn path(root: &Path) -> PathBuf {
        root.join("manifest.json")
    }

    /// Writes the manifest, the resolved configuration and the configuration of the transport into
    /// the run's root.
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
            write(self.root.join(name), text)?;
        }
        Ok(())
    }

    /// Returns the transport of the run.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn transport(&self) -> Result<Transport, StageError> {
        Transport::of(self)
    }
}

/// Writes a file of a run, which is the owner's alone.
pub(crate) fn write(path: PathBuf, text: &str) -> Result<(), StageError> {
    let opened = OpenOptions::new()
        .create(true)
        .truncate(true)
        .write(true)
        .mode(0o600)
        .open(&path);
    opened
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|source| StageError::File { path, source })
}

/// Makes all files that this process and its children create the owner's alone, whatever the umask
/// of the shell.
pub fn keep_files_private() {
    umask(Mode::RWXG | Mode::RWXO);
}

/// Lets this process get a signal when the process that has started it, `parent`, ends, even if
/// that is killed. False: it has ended already.
///
/// # Errors
/// The system refuses.
pub fn end_with(parent: i32, signal: Signal) -> Result<bool, Errno> {
    set_parent_process_death_signal(Some(signal))?;
    Ok(getppid().map(Pid::as_raw_pid) == Some(parent))
}
