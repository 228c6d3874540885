//! Shared memory is common to all users and programs of a machine: a run depends on none of them,
//! and leaves their files alone.

use std::{
    fs::{self, File},
    os::unix::fs::{MetadataExt, symlink},
    path::{Path, PathBuf},
    process::Command,
};

use gyre_transport::run::SHARED_MEMORY;

use crate::common::{Ended, OtherUser, Run, Running, leftovers, undisturbed, with_tmpfs};

/// A run of a short simulation by another user. `None` if this user cannot become another.
struct Other(Run, OtherUser);

impl Other {
    fn new() -> Option<Self> {
        let run = Run::simulated(8);
        let user = OtherUser::new(run.folder())?;
        Some(Self(run, user))
    }

    fn run(&self) -> Ended {
        Ended::of(self.1.command_of(&self.0))
    }

    fn runs(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("gyre-{}", self.1.id))
    }
}

#[test]
fn a_lock_that_another_program_holds_on_shared_memory_does_not_delay_a_run() {
    let directory = File::open(SHARED_MEMORY).unwrap();
    directory.lock().unwrap();
    Run::of_recording().complete();
}

#[test]
fn all_files_of_a_run_are_the_owners_alone_whatever_the_umask() {
    for umask in ["000", "777"] {
        let run = Run::of_recording().rate("12");
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("umask {umask}; exec \"$0\" \"$@\"")]);
        shell.arg(crate::PROGRAM).args(run.command().get_args());
        let mut running = run.start_as(shell);
        running.await_poses(3);
        let mut files = leftovers::shared_memory(run.out());
        assert!(!files.is_empty());
        files.push(leftovers::root(run.out()));
        files.push(leftovers::root(run.out()).with_extension("lock"));
        // Below these no other user gets.
        files.push(run.out().to_owned());
        for file in files {
            let mode = fs::metadata(&file).unwrap().mode();
            assert_eq!(mode & 0o077, 0, "{}: {mode:o}", file.display());
        }
        running.finish().succeeded();
        for result in [
            "odometry.csv",
            "config.toml",
            "log.jsonl",
            "journal/poses.journal",
        ] {
            let mode = fs::metadata(run.out().join(result)).unwrap().mode();
            assert_eq!(mode & 0o777, 0o600, "{result}: {mode:o}");
        }
    }
}

/// Runs a shell script with the shared memory of a running process.
fn in_shared_memory_of(pid: u32, script: &str) {
    let mut command = Command::new("nsenter");
    command.args(["--mount", "--target", &pid.to_string(), "sh", "-c", script]);
    command.output().unwrap();
}

const FILL: &str = "cat /dev/zero >> /dev/shm/filled-by-another-program";

/// Starts a run with little shared memory of its own, and waits for its first pose.
fn start_with_little_memory(run: &Run) -> Option<Running> {
    let command = with_tmpfs(&run.command(), Path::new(SHARED_MEMORY), "size=64m")?;
    let mut running = run.start_as(command);
    running.await_poses(1);
    Some(running)
}

#[test]
fn a_run_has_its_memory_before_another_program_fills_the_rest_and_a_restart_without_it_ends_it() {
    let run = Run::of_recording().rate("2");
    let Some(running) = start_with_little_memory(&run) else {
        return;
    };
    in_shared_memory_of(running.pid(), FILL);
    running.finish().succeeded().does_not_say("died");
    assert_eq!(run.odometry(), undisturbed());

    let run = Run::of_recording().rate("2");
    let Some(mut running) = start_with_little_memory(&run) else {
        return;
    };
    let source = running.await_stage("radar-replay");
    // The next run takes the resources of a dead process at once.
    let script =
        format!("{FILL}; kill -9 {source}; for i in $(seq 100); do {FILL}; sleep 0.01; done");
    in_shared_memory_of(running.pid(), &script);
    running
        .finish()
        .failed_with(&["died 6 times", "/dev/shm", "giving up"]);
}

#[test]
fn two_users_run_at_once() {
    let Some(other) = Other::new() else { return };
    let run = Run::of_recording().rate("6");
    let running = run.started(2);
    other.run().succeeded();
    assert!(!other.runs().exists());
    assert_eq!(running.complete(), undisturbed());
}

#[test]
fn a_directory_in_shared_memory_that_is_not_the_users_alone_is_refused_in_a_sentence() {
    let Some(other) = Other::new() else { return };
    let runs = other.runs();
    // A directory of this user, root, and a link to one.
    fs::create_dir(&runs).unwrap();
    let refused = other.run();
    fs::remove_dir(&runs).unwrap();
    refused.refused_with(&["belongs to user 0", "ask that user"]);
    symlink("/dev", &runs).unwrap();
    let refused = other.run();
    fs::remove_file(&runs).unwrap();
    refused.refused_with(&["is not a directory", "remove it"]);
}
