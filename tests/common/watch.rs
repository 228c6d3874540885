//! A `gyre echo` process: an observer of a run.

use std::{
    fs::{self, File},
    path::PathBuf,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::Signal;

use super::{Pid, Run, gyre, send};

const LIMIT: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(2);

/// A running observer. Dropped, it is killed.
pub struct Watch {
    child: Child,
    output: PathBuf,
    topic: &'static str,
}

/// The output of an observer.
#[derive(Debug)]
pub struct Watched {
    /// The sequence numbers of the messages.
    pub seqs: Vec<u64>,
    /// The sum of all `missed` lines.
    pub gaps: u64,
    /// Messages received and missed by its last line; `None` if it did not see the end of the run.
    pub total: Option<(u64, u64)>,
}

impl Watch {
    /// Starts one that watches a topic of a run.
    pub fn start(run: &Run, topic: &'static str) -> Self {
        let mut command = gyre();
        command.arg("echo").arg(run.out()).arg(topic);
        let (output, file) = output(run);
        let child = spawn(&mut command, file);
        Self {
            child,
            output,
            topic,
        }
    }

    /// Waits until it has printed a message.
    pub fn await_message(self) -> Self {
        let since = Instant::now();
        while self.read().seqs.is_empty() {
            assert!(since.elapsed() < LIMIT, "{}", self.text());
            assert!(!self.text().contains("gyre: "), "{}", self.text());
            thread::sleep(LOOK);
        }
        self
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) {
        send(self.pid(), signal);
    }

    /// Kills the process and returns its output.
    pub fn kill(mut self) -> Watched {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.read()
    }

    /// Waits until the process ends, and returns its output.
    pub fn finish(mut self) -> Watched {
        let since = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            assert!(since.elapsed() < LIMIT, "it goes on: {}", self.text());
            thread::sleep(LOOK);
        }
        self.read()
    }

    fn pid(&self) -> Pid {
        self.child.id()
    }

    fn text(&self) -> String {
        fs::read_to_string(&self.output).unwrap()
    }

    fn read(&self) -> Watched {
        let text = self.text();
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

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
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

fn output(run: &Run) -> (PathBuf, File) {
    let free = |i: &usize| !run.folder().join(format!("watch-{i}.txt")).exists();
    let number = (0..).find(free).unwrap_or_default();
    let path = run.folder().join(format!("watch-{number}.txt"));
    let file = File::create(&path).unwrap();
    (path, file)
}

fn spawn(command: &mut Command, output: File) -> Child {
    let errors = output.try_clone().unwrap();
    let command = command.stdin(Stdio::null()).stdout(output).stderr(errors);
    command.spawn().unwrap()
}
