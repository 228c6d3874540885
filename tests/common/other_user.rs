//! A user without privileges, for tests of rights that only root has.

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::{self, Command},
    sync::atomic::{AtomicU32, Ordering},
};

use rustix::process::geteuid;

use super::{Run, copy_program};

/// Another user with a copy of the program in a folder that is open to all.
pub struct OtherUser {
    pub id: u32,
    program: PathBuf,
}

impl OtherUser {
    /// `None`, with a message, if this user cannot become a different user.
    pub fn new(folder: &Path) -> Option<Self> {
        if !geteuid().is_root() {
            println!("skipped: only root can become another user");
            return None;
        }
        fs::set_permissions(folder, fs::Permissions::from_mode(0o777)).unwrap();
        let program = folder.join("gyre");
        copy_program(&program);
        // Tests that run at the same time are different users.
        static USERS: AtomicU32 = AtomicU32::new(0);
        let id = 1_000_000 + 10 * process::id() + USERS.fetch_add(1, Ordering::Relaxed);
        Some(Self { id, program })
    }

    /// A command of this user; the caller adds a program and its arguments.
    pub fn command(&self) -> Command {
        let id = self.id.to_string();
        let mut command = Command::new("setpriv");
        command.args(["--reuid", &id, "--regid", &id, "--clear-groups"]);
        command
    }

    pub fn gyre(&self) -> Command {
        let mut command = self.command();
        command.arg(&self.program);
        command
    }

    pub fn command_of(&self, run: &Run) -> Command {
        let mut command = self.gyre();
        command.args(run.command().get_args());
        command
    }
}
