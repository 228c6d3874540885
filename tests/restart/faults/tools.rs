//! Programs of the system that make faults.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::common::{Pid, processes::is_alive, works};

/// Limits a resource of a process. That the process is gone already is no error.
pub fn limit(pid: Pid, resource: &str, value: u64) {
    let (of, limit) = (format!("--pid={pid}"), format!("--{resource}={value}:"));
    assert!(
        works(&["prlimit", &of, &limit]) || !is_alive(pid),
        "cannot limit {resource} of {pid}"
    );
}

/// A mounted file system. Dropped, it is unmounted.
pub struct Mount(PathBuf);

impl Mount {
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
