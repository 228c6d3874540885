//! Programs of the system that make faults.

use std::{
    fs::{self, Permissions},
    os::unix::fs::{PermissionsExt, chown},
    path::{Path, PathBuf},
    process::Command,
};

use crate::common::{Pid, Run, processes::is_alive};

/// A user and group without rights: nobody.
const NOBODY: u32 = 65534;

/// A requirement of a kind of faults on the machine.
#[derive(Clone, Copy)]
pub enum Need {
    /// Mounting, also in a namespace of its own.
    Mounts,
    /// Another user who can execute the program.
    OtherUser,
}

impl Need {
    /// Returns the name of the missing tool; `None` if nothing is.
    pub fn missing(self) -> Option<&'static str> {
        let (there, missing) = match self {
            Self::Mounts => (
                works(&[
                    "unshare", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt",
                ]),
                "mounting needs root (CAP_SYS_ADMIN)",
            ),
            Self::OtherUser => (
                works(&[&AS_NOBODY[..], &[crate::PROGRAM, "--version"]].concat()),
                "another user cannot execute the program (needs root, and a build folder that all can read)",
            ),
        };
        (!there).then_some(missing)
    }
}

/// Executes a command as nobody.
pub const AS_NOBODY: [&str; 4] = [
    "setpriv",
    "--reuid=65534",
    "--regid=65534",
    "--clear-groups",
];

/// Lets nobody write the run's results.
pub fn give_to_nobody(run: &Run) {
    fs::set_permissions(run.folder(), Permissions::from_mode(0o755)).unwrap();
    fs::create_dir_all(run.out()).unwrap();
    chown(run.out(), Some(NOBODY), Some(NOBODY)).unwrap();
}

fn works(command: &[&str]) -> bool {
    let output = Command::new(command[0]).args(&command[1..]).output();
    output.is_ok_and(|output| output.status.success())
}

/// Limits a resource of a process of this user, or of nobody. That the process is gone already is
/// no error.
pub fn limit(pid: Pid, resource: &str, value: u64) {
    let (pid_option, limit) = (format!("--pid={pid}"), format!("--{resource}={value}:"));
    let prlimit = ["prlimit", &pid_option, &limit];
    assert!(
        works(&prlimit) || works(&[&AS_NOBODY[..], &prlimit].concat()) || !is_alive(pid),
        "cannot limit {resource} of {pid}"
    );
}

/// A mounted file system. Dropped, it is unmounted.
pub struct Mount(PathBuf);

impl Mount {
    /// A file system in memory.
    pub fn tmpfs(place: &Path, bytes: u64) -> Self {
        fs::create_dir_all(place).unwrap();
        let mount = Self(place.to_owned());
        mount.mount(&[
            "-t",
            "tmpfs",
            "-o",
            &format!("size={bytes},mode=755"),
            "tmpfs",
        ]);
        mount
    }

    pub fn remount(&self, options: &str) {
        self.mount(&["-o", &format!("remount,{options}")]);
    }

    fn mount(&self, options: &[&str]) {
        let place = self.0.to_str().unwrap();
        assert!(
            works(&[&["mount"][..], options, &[place]].concat()),
            "{place}"
        );
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).output();
    }
}
