//! Waiting for the end of a process.

use std::{
    process::Child,
    time::{Duration, Instant},
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
    process::{Pid, PidfdFlags, pidfd_open},
};

/// Waits until a child process has exited, at most for `limit`; returns whether it has. Its status
/// is left to be read.
pub(crate) fn ends_within(process: &Child, limit: Duration) -> bool {
    let pid = Pid::from_child(process);
    let Ok(descriptor) = pidfd_open(pid, PidfdFlags::empty()) else {
        // It has been waited for already.
        return true;
    };
    let deadline = Instant::now() + limit;
    loop {
        let rest = deadline.saturating_duration_since(Instant::now());
        let rest = Timespec {
            tv_sec: rest.as_secs() as i64,
            tv_nsec: i64::from(rest.subsec_nanos()),
        };
        let mut polled = [PollFd::new(&descriptor, PollFlags::IN)];
        match poll(&mut polled, Some(&rest)) {
            Err(Errno::INTR) => {}
            ready => return ready.is_ok_and(|ready| ready > 0),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_process_that_does_not_die_is_waited_for_with_a_limit() {
        let mut process = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        assert!(!ends_within(&process, Duration::from_millis(50)));
        process.kill().unwrap();
        assert!(ends_within(&process, Duration::from_secs(60)));
        process.wait().unwrap();
        assert!(ends_within(&process, Duration::from_secs(60)));
    }
}
