//! A run: its name and its files. Its root is on tmpfs (`/dev/shm/gyre-<uid>/<name>`), where the
//! transport's bookkeeping makes recovery four times faster than on a disk.

mod root;

use std::path::{Path, PathBuf};

use rustix::{
    fs::Mode,
    io::Errno,
    process::{Pid, Signal, getppid, set_parent_process_death_signal, umask},
};

pub use crate::manifest::write;
pub use crate::shared_memory::{SHARED_MEMORY, free_shared_memory};
pub use root::{RunRoot, close_to_others, own_files, root_of, sweep, sweep_run};
pub use root::{is_alive, roots};

/// The environment variable with the path of the run's root.
pub const ENVIRONMENT: &str = "GYRE_RUN";

/// The environment variable of a process that stands by for its predecessor. After loading its data
/// it creates the file `NAME.ready` in the run's root, and it opens its topics when its standard
/// input ends.
pub const STANDBY: &str = "GYRE_STANDBY";

pub fn ready_file(root: &Path, process: &str) -> PathBuf {
    root.join(format!("{process}.ready"))
}

/// Makes all files that this process and its children create the owner's alone, whatever the umask
/// of the shell.
pub fn keep_files_private() {
    umask(Mode::RWXG | Mode::RWXO);
}

/// Lets this process get a signal when the process that has started it, `parent`, ends, even if
/// that is killed. False: it has ended already.
pub fn end_with(parent: i32, signal: Signal) -> Result<bool, Errno> {
    set_parent_process_death_signal(Some(signal))?;
    Ok(getppid().map(Pid::as_raw_pid) == Some(parent))
}
