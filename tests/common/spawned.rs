//! A command that runs beside a run, with its words in a file.

use std::{
    fs::{self, File},
    path::PathBuf,
    process::{Child, Command, ExitStatus, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::Signal;

use super::{Pid, send};

/// A run of the small recording takes a second or two, far more only on a loaded machine.
pub(super) const LIMIT: Duration = Duration::from_secs(90);
pub(super) const LOOK: Duration = Duration::from_millis(2);

/// A running command. Dropped, it is killed.
pub struct Spawned {
    pub(super) child: Child,
    pub(super) said: PathBuf,
}

impl Spawned {
    /// Starts a command that writes to this file.
    pub fn new(mut command: Command, said: PathBuf) -> Self {
        let output = File::create(&said).unwrap();
        let errors = output.try_clone().unwrap();
        command.stdin(Stdio::null()).stdout(output).stderr(errors);
        let child = command.spawn().unwrap();
        Self { child, said }
    }

    pub fn pid(&self) -> Pid {
        self.child.id()
    }

    pub fn signal(&self, signal: Signal) {
        send(self.pid(), signal);
    }

    pub fn said(&self) -> String {
        fs::read_to_string(&self.said).unwrap()
    }

    pub fn is_over(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    pub fn until<T>(&self, look: impl Fn(&str) -> Option<T>) -> T {
        let since = Instant::now();
        loop {
            let said = self.said();
            if let Some(seen) = look(&said) {
                return seen;
            }
            assert!(since.elapsed() < LIMIT, "{said}");
            thread::sleep(LOOK);
        }
    }

    pub fn wait(&mut self) -> ExitStatus {
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(since.elapsed() < LIMIT, "it goes on: {}", self.said());
            thread::sleep(LOOK);
        }
    }

    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Spawned {
    fn drop(&mut self) {
        self.kill();
    }
}
