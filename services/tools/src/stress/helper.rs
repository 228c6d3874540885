//! Child processes that load the machine: `gyre stress-helper PARENT WORK`.
//!
//! A helper ends with the process that has started it, even if that is killed.

use std::{
    fs,
    hint::black_box,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use gyre_client::{MAX_WAIT, Run, Signals, memory, run::end_with, wait_for_any};
use gyre_configuration::terminal::{Failure, own, print};
use gyre_contract::topics;
use rustix::process::Signal;
use serde::{Deserialize, Serialize};

/// The command of `gyre` that calls [`help`].
pub const COMMAND: &str = "stress-helper";

/// The line that a helper prints when it works.
const READY: &str = "ready";
/// Memory that is always left, whatever the share: room for other programs that start meanwhile.
const LEFT: u64 = 1 << 30;
const PIECE: usize = 32 << 20;
const PAGE: usize = 4096;
/// The time for allocating memory before the measurement. On a large machine all of it would take
/// minutes.
const TAKING: Duration = Duration::from_secs(20);
/// Time between two polls for memory when there is no more to take.
const PAUSE: Duration = Duration::from_millis(20);

/// The work of a helper, which it gets as JSON on its command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    Spin,
    /// Takes this share of the available memory, and churns it.
    Memory(f64),
    /// Reads all topics of the run that writes to this folder.
    Observe(PathBuf),
}

pub fn help(arguments: &[String]) -> Result<(), Failure> {
    let usage = || format!("`gyre {COMMAND}` is what `gyre stress` starts");
    let [parent, work] = arguments else {
        return Err(usage().into());
    };
    let parent = parent.parse().map_err(|_| usage())?;
    let work: Work = serde_json::from_str(work).map_err(|_| usage())?;
    if !end_with(parent, Signal::KILL)? {
        return Err("interrupted".into());
    }
    match work {
        Work::Spin => spin(),
        Work::Memory(share) => churn(share),
        Work::Observe(out) => observe(&out),
    }
}

/// A helper process. It is killed when this is dropped.
#[derive(Debug)]
pub struct Helper {
    work: Work,
    process: Child,
}

impl Helper {
    /// Starts a helper, and waits until it works.
    pub fn start(work: Work) -> Result<Self, Failure> {
        let spawned = Command::new(own())
            .arg(COMMAND)
            .arg(std::process::id().to_string())
            .arg(serde_json::to_string(&work)?)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn();
        let mut process =
            spawned.map_err(|error| format!("cannot start a helper process: {error}"))?;
        let mut line = String::new();
        let output = process.stdout.take().map(BufReader::new);
        let read = output.map(|mut output| output.read_line(&mut line));
        let helper = Self { work, process };
        match read {
            Some(Ok(_)) if line.trim_end() == READY => Ok(helper),
            _ => {
                let work = &helper.work;
                Err(
                    format!("the helper process `{work:?}` has ended; its output has the reason")
                        .into(),
                )
            }
        }
    }

    /// Returns a sentence about a helper that has ended although it should still work.
    pub fn has_died(&mut self) -> Option<String> {
        let status = self.process.try_wait().ok().flatten()?;
        Some(format!("`{:?}` has ended: {status}", self.work))
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn spin() -> ! {
    let _ = print::line(READY);
    let mut number = 1_u64;
    loop {
        number = black_box(number.wrapping_mul(6_364_136_223_846_793_005));
    }
}

/// Allocates memory up to this share of the available memory, then frees and allocates pieces of it
/// without end.
fn churn(share: f64) -> Result<(), Failure> {
    // If memory runs out all the same, this process is the one to end.
    let _ = fs::write("/proc/self/oom_score_adj", "1000");
    let available = memory::left().ok_or("the memory that is available is not known")?;
    let most = (available as f64 * share.clamp(0.0, 0.95)) as u64;
    let mut pieces: Vec<Vec<u8>> = Vec::new();
    let has_room = || memory::left().is_some_and(|left| left > LEFT + PIECE as u64);
    let began = Instant::now();
    while ((pieces.len() * PIECE) as u64) < most && has_room() && began.elapsed() < TAKING {
        pieces.push(piece());
    }
    if pieces.is_empty() {
        let (available_mb, left_mb) = (available as f64 * 1e-6, LEFT as f64 * 1e-6);
        return Err(format!("no memory was taken: {available_mb:.0} MB are available, and {left_mb:.0} MB are always left").into());
    }
    print::line(READY)?;
    loop {
        for taken in &mut pieces {
            *taken = Vec::new();
            if has_room() {
                *taken = piece();
            }
        }
        if !has_room() {
            // Others need it.
            pieces.pop();
            thread::sleep(PAUSE);
        }
        pieces.retain(|piece| !piece.is_empty());
        if pieces.is_empty() {
            thread::sleep(PAUSE);
        }
    }
}

fn piece() -> Vec<u8> {
    let mut piece = vec![0; PIECE];
    piece.iter_mut().step_by(PAGE).for_each(|byte| *byte = 1);
    black_box(piece)
}

/// Copies the messages of all topics of a run until it ends.
fn observe(out: &Path) -> Result<(), Failure> {
    let (run, signals) = (Run::open(out)?, Signals::install()?);
    let observers = topics(&run.manifest().window).map(|topic| run.observe_topic(topic));
    let mut observers = observers.collect::<Result<Vec<_>, _>>()?;
    print::line(READY)?;
    while !observers.iter().all(|it| it.has_ended()) {
        let listeners: Vec<_> = observers.iter().map(|it| it.listener()).collect();
        if wait_for_any(&signals, &listeners, MAX_WAIT)? {
            break;
        }
        for observer in &mut observers {
            while let Some(message) = observer.take()? {
                black_box(message);
            }
        }
    }
    Ok(())
}
