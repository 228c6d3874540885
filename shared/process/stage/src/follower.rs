//! The loop of a follower: a process that reads durable logs at its own pace, and publishes for
//! observers. No stage waits for it, and it gives no credit. An event wakes it when a log has
//! grown; as events can be lost, it looks every 200 ms.

use std::{thread, time::Duration};

use gyre_contract::{Header, Item, Message, run::StageCounters};
use gyre_storage::{has_room, was_full};
use gyre_transport::services::LogId;

use crate::{Launch, counters::Work};
pub use gyre_transport::transport::Notifier;
use gyre_transport::{
    Listener, Manifest, RunError,
    numbers::{self, Numbers},
    wake,
    writer::Writer,
};

/// Priority of a follower among the processes of the machine: it computes while no stage does.
const NICENESS: i32 = 10;

pub trait Follower {
    type Output: Message;
    /// The logs whose growth wakes it.
    const LOGS: &'static [LogId];

    /// Works on the next records of the logs. A step should be short: requests to stop are looked
    /// for between two steps.
    fn step(&mut self) -> Result<Step<<Self::Output as Message>::Header>, RunError>;

    /// Makes its writes survive a power failure. A failure is found by nobody after the process.
    fn sync(&mut self) -> Result<(), RunError> {
        Ok(())
    }

    fn progress(&self) -> Progress;
}

#[derive(Debug)]
pub enum Step<H> {
    Idle,
    /// Records were worked on, and there may be more. The message is published.
    Worked(Option<H>),
    /// The logs have been read to their end, and all that follows from them is written.
    Ended,
}

/// Runs a follower to the end of its logs, or until SIGTERM.
pub fn run<F: Follower>(launch: &Launch, follower: &mut F) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    // Only latency depends on it.
    let _ = rustix::process::nice(NICENESS);
    let logs = F::LOGS.iter();
    let listeners = logs.map(|log| Listener::open(&launch.node, log.name()));
    let listeners: Vec<Listener> = listeners.collect::<Result<_, _>>()?;
    let grown: Vec<&Listener> = listeners.iter().collect();
    launch.begin_heartbeat()?;
    let mut flow = Flow {
        output: Writer::open(&launch.node, &launch.manifest)?,
        report: Numbers::open(&launch.manifest, &file_of(&launch.name))?,
        delay: launch.delay()?,
        next_seq: 0,
        counters: StageCounters::default(),
    };
    let mut limit = Duration::ZERO;
    loop {
        // Before the step: records appended after this wake the next one.
        let woken = launch
            .signals
            .wait(&grown, Some(flow.output.listener()), limit)?;
        flow.counters.wakes += u64::from(!limit.is_zero());
        if woken.stop {
            follower.sync()?;
            return Ok(flow.counters);
        }
        if woken.may_have_new_readers {
            flow.output.accept_readers()?;
        }
        let slept = !limit.is_zero();
        let step = flow.step(follower);
        if let Err(error) = &step
            && was_full()
        {
            await_room(launch)?;
            return Err(RunError::Transient(error.to_string()));
        }
        limit = match step? {
            Step::Idle => wake::MAX_WAIT,
            Step::Worked(_) => Duration::ZERO,
            Step::Ended => return Ok(flow.counters),
        };
        if limit.is_zero() && slept && woken.timed_out {
            flow.counters.wakes_caught_late += 1;
        }
    }
}

/// Waits until the full disk has room: the follower is then started again, from its logs.
fn await_room(launch: &Launch) -> Result<(), RunError> {
    tracing::warn!("the disk is full: waiting for room");
    while !has_room(&launch.manifest.out) {
        if launch.signals.sleep(wake::MAX_WAIT)? {
            return Err(RunError::Stopped);
        }
    }
    Ok(())
}

struct Flow<M: Message> {
    output: Writer<M>,
    /// [`Progress::done`], [`Progress::total`], and 1 at the end of the logs.
    report: Numbers<3>,
    delay: Duration,
    next_seq: u64,
    counters: StageCounters,
}

impl<M: Message> Flow<M> {
    fn step<F: Follower<Output = M>>(
        &mut self,
        follower: &mut F,
    ) -> Result<Step<M::Header>, RunError> {
        let work = Work::begin();
        let mut step = follower.step()?;
        if let Step::Worked(message) = &mut step {
            work.end(&mut self.counters);
            if let Some(header) = message.take() {
                self.next_seq = header.item().seq.saturating_add(1);
                self.output.publish(header, None)?;
            }
            if !self.delay.is_zero() {
                thread::sleep(self.delay);
            }
        }
        let has_ended = matches!(step, Step::Ended);
        if has_ended {
            follower.sync()?;
            self.output.end(Item::numbered(self.next_seq), None)?;
        }
        let Progress { done, total } = follower.progress();
        self.report.write([done, total, has_ended.into()])?;
        Ok(step)
    }
}

/// The position of a follower. The supervisor learns from its file whether the follower has come to
/// its end, which no exit code shows: a follower that was asked to end exits as well.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    pub done: u64,
    pub total: u64,
}

impl Progress {
    pub fn of(done: usize, total: usize) -> Self {
        let [done, total] = [done, total].map(|it| it as u64);
        Self { done, total }
    }
}

/// Returns the progress of a follower and whether it has come to its end; `None` before its first
/// step.
pub fn progress_of(manifest: &Manifest, follower: &str) -> Option<(Progress, bool)> {
    let [done, total, ended] = numbers::read(&manifest.root.join(file_of(follower)))?;
    Some((Progress { done, total }, ended == 1))
}

fn file_of(follower: &str) -> String {
    format!("{follower}.progress")
}
