//! The machine's resources that a process uses, as the kernel counts it.

use std::time::Duration;

use procfs::{
    ProcResult,
    process::{Process, Status},
};
use serde::{Deserialize, Serialize};

/// The resources that a process has used since its start, and the memory that it has now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Usage {
    /// Processor time of all threads, s.
    pub cpu_s: f64,
    /// Memory that is the process's own, bytes: neither files nor memory that it shares with
    /// others.
    pub own_bytes: u64,
    /// Memory that is mapped into the process and present, bytes, with what it shares.
    pub resident_bytes: u64,
    /// Times that its threads have gone to sleep: each is a wake-up. A thread that has ended
    /// takes its count with it.
    pub wake_ups: u64,
    /// Times that its threads were taken off a processor while they had work; those of threads
    /// that have ended are gone too.
    pub preemptions: u64,
    /// Number of threads.
    pub threads: u64,
}

impl Usage {
    /// Returns the usage of a process; `None` if it has ended, or belongs to another user.
    pub fn of(pid: u32) -> Option<Self> {
        Self::read(pid).ok()
    }

    fn read(pid: u32) -> ProcResult<Self> {
        let process = Process::new(pid as i32)?;
        let (stat, status) = (process.stat()?, process.status()?);
        let mut usage = Self {
            cpu_s: (stat.utime + stat.stime) as f64 / procfs::ticks_per_second() as f64,
            own_bytes: kilobytes(status.rssanon),
            resident_bytes: kilobytes(status.vmrss),
            threads: status.threads,
            ..Self::default()
        };
        for task in process.tasks()? {
            // A thread may end meanwhile.
            let status: ProcResult<Status> = task.and_then(|task| task.status());
            if let Ok(status) = status {
                usage.wake_ups += status.voluntary_ctxt_switches.unwrap_or_default();
                usage.preemptions += status.nonvoluntary_ctxt_switches.unwrap_or_default();
            }
        }
        Ok(usage)
    }

    /// Returns the share of one processor that was used since `earlier`, `elapsed` ago.
    pub fn processor_share(&self, earlier: &Self, elapsed: Duration) -> f64 {
        (self.cpu_s - earlier.cpu_s).max(0.0) / elapsed.as_secs_f64().max(1e-9)
    }
}

/// Returns a number of kilobytes in bytes.
fn kilobytes(number: Option<u64>) -> u64 {
    number.unwrap_or_default() * 1024
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{process::Command, thread, time::Instant};

    use super::*;

    /// Other tests begin and end threads, and free memory: a process of its own is measured.
    #[test]
    fn work_sleep_and_memory_of_a_process_are_counted() {
        const ALONE: &str = "GYRE_TEST_ALONE";
        if std::env::var_os(ALONE).is_some() {
            return use_and_measure();
        }
        let name = "usage::tests::work_sleep_and_memory_of_a_process_are_counted";
        let ended = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", name])
            .env(ALONE, "")
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ended.stdout);
        assert!(ended.status.success() && said.contains("1 passed"), "{said}");
    }

    fn use_and_measure() {
        let own = || Usage::of(std::process::id()).unwrap();
        let before = own();
        let memory = vec![1_u8; 64 << 20];
        let until = Instant::now() + Duration::from_secs(60);
        while own().cpu_s - before.cpu_s < 0.05 {
            assert!(Instant::now() < until);
        }
        (0..10).for_each(|_| thread::sleep(Duration::from_millis(1)));
        let after = own();
        assert!(after.own_bytes >= before.own_bytes + (60 << 20));
        assert!(after.wake_ups >= before.wake_ups + 10);
        assert!(after.processor_share(&before, Duration::from_secs(1)) >= 0.05);
        drop(memory);
    }

    #[test]
    fn a_process_that_has_ended_uses_nothing() {
        let mut process = Command::new("true").spawn().unwrap();
        process.wait().unwrap();
        assert_eq!(Usage::of(process.id()), None);
    }
}
