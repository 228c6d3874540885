//! Waiting for the end of a process.

use std::{
    process::Child,
    thread,
    time::{Duration, Instant},
};

const PAUSE: Duration = Duration::from_micros(200);

/// Waits until a child process has exited, at most for `limit`; returns whether it has.
pub(crate) fn ends_within(process: &mut Child, limit: Duration) -> bool {
    let deadline = Instant::now() + limit;
    loop {
        let has_ended = process.try_wait().is_ok_and(|status| status.is_some());
        if has_ended || Instant::now() >= deadline {
            return has_ended;
        }
        thread::sleep(PAUSE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_does_not_die_is_waited_for_with_a_limit() {
        let mut process = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        assert!(!ends_within(&mut process, Duration::from_millis(50)));
        process.kill().unwrap();
        assert!(ends_within(&mut process, Duration::from_secs(60)));
        assert!(ends_within(&mut process, Duration::ZERO));
    }
}
