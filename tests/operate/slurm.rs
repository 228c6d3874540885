//! `gyre batch` as an array of Slurm.

use std::{path::Path, process::Command};

use tempfile::TempDir;

use crate::{PROJECT, common::Ended, operate::batch::Drives};

/// Slurm on this computer alone, in a folder. Dropped, it is stopped.
struct Slurm {
    folder: TempDir,
}

impl Slurm {
    /// Starts Slurm; prints why a test is skipped if there is no Slurm.
    fn start() -> Option<Self> {
        let look = "for it in slurmctld slurmd munged sbatch; do command -v $it || exit 1; done";
        let found = Command::new("sh").args(["-c", look]).output();
        let is_there = found.is_ok_and(|output| output.status.success());
        if !is_there || !rustix::process::geteuid().is_root() {
            println!("skipped: Slurm and munge are not installed, or this is not root");
            return None;
        }
        let slurm = Self {
            folder: crate::common::folder(),
        };
        let started = slurm.script("start").status().unwrap();
        assert!(started.success());
        Some(slurm)
    }

    fn script(&self, action: &str) -> Command {
        let mut command = Command::new(format!("{PROJECT}/examples/slurm/one-node.sh"));
        command.arg(self.folder.path()).arg(action);
        command
    }

    fn sbatch(&self) -> Command {
        let (mut command, folder) = (Command::new("sbatch"), self.folder.path());
        command.env("SLURM_CONF", folder.join("slurm.conf"));
        command.current_dir(folder).args(["--parsable", "--wait"]);
        command
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = self.script("stop").status();
    }
}

#[test]
fn an_array_of_slurm_gives_the_same_table() {
    let Some(slurm) = Slurm::start() else {
        return;
    };
    let drives = Drives::new().recordings(&[4, 5, 6]);
    let nowhere = drives.path("nowhere");
    let drives = drives.line("missing", &nowhere, "");
    let alone = drives.batch("alone");
    assert_eq!(alone.finish().code(), Some(1));
    let array = drives.batch("array");
    let programs = Path::new(crate::PROGRAM).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    let mut sbatch = slurm.sbatch();
    sbatch.env("PATH", path).env("TASKS", "2");
    sbatch.args(["--array=0-1", "--cpus-per-task=1", "--mem-per-cpu=0"]);
    sbatch.arg(format!("{PROJECT}/examples/slurm/gyre.sbatch"));
    sbatch.arg(drives.path("list.csv")).arg(&array.out);
    sbatch.arg("--config").arg(drives.path("small.toml"));
    // One of its drives is missing.
    let submitted = Ended::of(sbatch);
    assert_eq!(submitted.code(), Some(1), "{}", submitted.stderr);
    let ended = array.clone().with(&["--collect"]).finish();
    assert_eq!(ended.code(), Some(1));
    assert_eq!(array.table(), alone.table());
}
