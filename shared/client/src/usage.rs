//! The machine's resources that a process uses, as the kernel counts it.

use std::{fs, path::Path, time::Duration};

use gyre_contract::control::Status;
use serde::{Deserialize, Serialize};

use crate::ProcessStat;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Usage {
    pub cpu_s: f64,
    /// Neither files nor memory that it shares with others.
    pub own_bytes: u64,
    /// Memory that is mapped into the process and present, bytes, including shared memory.
    pub resident_bytes: u64,
    /// Times that its threads have gone to sleep; counts of ended threads are gone.
    pub wake_ups: u64,
    /// Times that its threads were taken off a processor while they had work.
    pub preemptions: u64,
    pub threads: u64,
}

impl Usage {
    /// Returns the usage of a process; `None` if it has ended, or belongs to another user.
    pub fn of(pid: u32) -> Option<Self> {
        let folder = format!("/proc/{pid}");
        let of_process = status(Path::new(&folder))?;
        let mut usage = Self {
            cpu_s: ProcessStat::of(pid)?.cpu_s,
            own_bytes: 1024 * count(&of_process, "RssAnon:"),
            resident_bytes: 1024 * count(&of_process, "VmRSS:"),
            threads: count(&of_process, "Threads:"),
            ..Self::default()
        };
        for thread in fs::read_dir(folder + "/task").ok()?.flatten() {
            // It may end meanwhile.
            let of_thread = status(&thread.path()).unwrap_or_default();
            usage.wake_ups += count(&of_thread, "voluntary_ctxt_switches:");
            usage.preemptions += count(&of_thread, "nonvoluntary_ctxt_switches:");
        }
        Some(usage)
    }

    pub fn processor_share(&self, earlier: &Self, elapsed: Duration) -> f64 {
        (self.cpu_s - earlier.cpu_s).max(0.0) / elapsed.as_secs_f64().max(1e-9)
    }
}

#[derive(Serialize)]
pub struct UsedRun {
    pub status: Status,
    /// The usage of each process, in the order of the status; `None` if it has ended.
    pub usage: Vec<Option<Usage>>,
}

impl UsedRun {
    pub fn of(status: Status) -> Self {
        let usage = status.processes.iter().map(|it| Usage::of(it.pid));
        Self {
            usage: usage.collect(),
            status,
        }
    }
}

fn status(folder: &Path) -> Option<String> {
    fs::read_to_string(folder.join("status")).ok()
}

/// Returns the number behind a name at the beginning of a line; 0 without the name.
fn count(status: &str, name: &str) -> u64 {
    let value = status.lines().find_map(|line| line.strip_prefix(name));
    let number = value.and_then(|value| value.split_whitespace().next()?.parse().ok());
    number.unwrap_or_default()
}

#[cfg(test)]
mod tests {
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
        assert!(
            ended.status.success() && said.contains("1 passed"),
            "{said}"
        );
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
