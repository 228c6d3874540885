//! Programs of the system that make faults.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use rustix::fs::{FallocateFlags, fallocate, statvfs};

use crate::common::{Pid, processes::is_alive, works};

/// The file that fills a disk.
const FILLER: &str = "filler";

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

    /// Leaves at most `leave` bytes.
    pub fn fill(&self, leave: u64) {
        let filler = fs::File::create(self.0.join(FILLER)).unwrap();
        loop {
            let free = statvfs(&self.0).unwrap();
            let bytes = (free.f_bavail * free.f_frsize).saturating_sub(leave);
            let filled = filler.metadata().unwrap().len();
            // Fails if another process is faster.
            if bytes == 0 || fallocate(&filler, FallocateFlags::empty(), filled, bytes).is_ok() {
                break;
            }
        }
    }

    pub fn free(&self) {
        let _ = fs::remove_file(self.0.join(FILLER));
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
