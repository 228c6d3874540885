//! A `gyre echo` process: an observer of a run.

use std::sync::atomic::{AtomicUsize, Ordering};

use rustix::process::Signal;

use super::{Run, gyre, spawned::Spawned};

pub struct Watch {
    process: Spawned,
    topic: &'static str,
}

#[derive(Debug)]
pub struct Watched {
    pub seqs: Vec<u64>,
    /// The sum of all `missed` lines.
    pub gaps: u64,
    /// Messages received and missed by its last line; `None` if it did not see the end of the run.
    pub total: Option<(u64, u64)>,
}

impl Watch {
    pub fn start(run: &Run, topic: &'static str) -> Self {
        static STARTED: AtomicUsize = AtomicUsize::new(0);
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let mut command = gyre();
        command.arg("echo").arg(run.out()).arg(topic);
        let said = run.folder().join(format!("watch-{number}.txt"));
        let process = Spawned::new(command, said);
        Self { process, topic }
    }

    pub fn await_message(self) -> Self {
        self.process.until(|said| {
            assert!(!said.contains("gyre: "), "{said}");
            (!self.read(said).seqs.is_empty()).then_some(())
        });
        self
    }

    pub fn signal(&self, signal: Signal) {
        self.process.signal(signal);
    }

    pub fn kill(mut self) -> Watched {
        self.process.kill();
        self.read(&self.process.said())
    }

    pub fn finish(mut self) -> Watched {
        self.process.wait();
        self.read(&self.process.said())
    }

    fn read(&self, text: &str) -> Watched {
        // The last line may be incomplete.
        let lines: Vec<&str> = text
            .split_inclusive('\n')
            .filter_map(|line| line.strip_suffix('\n'))
            .collect();
        let seq = |line: &&str| line.split_once(": scan ")?.0.parse().ok();
        let gap = |line: &&str| line.strip_suffix(" missed")?.parse::<u64>().ok();
        let total = |line: &&str| {
            let counts = line.strip_prefix(self.topic)?.strip_prefix(": ")?;
            let (received, missed) = counts.strip_suffix(" missed")?.split_once(" received, ")?;
            Some((received.parse().ok()?, missed.parse().ok()?))
        };
        Watched {
            seqs: lines.iter().filter_map(seq).collect(),
            gaps: lines.iter().filter_map(gap).sum(),
            total: lines.last().and_then(total),
        }
    }
}

impl Watched {
    /// Asserts that each message came once and in order, and that all that is missing is counted.
    /// `items` is the number of items of a run whose end it has seen.
    pub fn assert_consistent(&self, items: u64) -> &Self {
        let first = self.seqs.first().copied().unwrap_or(items);
        let last = self.seqs.last().copied().unwrap_or(items);
        assert!(self.seqs.is_sorted_by(|a, b| a < b), "{self:?}");
        let received = self.seqs.len() as u64;
        if received > 0 {
            assert_eq!(last - first + 1, received + self.gaps, "{self:?}");
        }
        if let Some((counted, missed)) = self.total {
            assert_eq!(counted, received, "{self:?}");
            assert_eq!(counted + missed, items - first, "{self:?}");
        }
        self
    }
}
