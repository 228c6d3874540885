//! The loop of a stage between source and sink: wait, take the inputs of the next item, process
//! them, publish.

use std::{thread, time::Duration};

use gyre_contract::{Header, Hop, Item, Message, run::StageCounters};
use gyre_transport::{
    RunError,
    wake::{self, Signals},
    writer::{Draft, Writer},
};

use crate::{
    Launch,
    counters::Work,
    inputs::{Action, Inputs},
};

/// A stage: a function of its inputs. This crate does the waiting, joining, publishing and
/// restarting.
pub trait Stage {
    type Inputs: Inputs;
    type Output: Message;
    /// The stage that it is, or replaces; its time stamps in an item are the hop of this name.
    const HOP: gyre_contract::StageId;

    /// Processes one item: reads borrowed shared memory and writes header and payload of a loaned
    /// sample. The item of the header is filled in afterwards.
    fn process(
        &mut self,
        input: <Self::Inputs as Inputs>::View<'_>,
        output: &mut Draft<Self::Output>,
    ) -> Result<(), RunError>;

    /// Adds the findings from the last processed item to its identity, which all later messages
    /// carry.
    fn identify(&self, _item: &mut Item) {}
}

/// Runs a stage until SIGTERM.
pub fn run<S: Stage>(launch: &Launch, stage: &mut S) -> Result<StageCounters, RunError> {
    // A program that stands by for a swap waits here until the process before it has ended.
    launch.take_place()?;
    let inputs = S::Inputs::open(launch)?;
    let output = Writer::open(&launch.node, &launch.manifest)?;
    let mut flow = Flow {
        stage,
        signals: &launch.signals,
        inputs,
        output,
        delay: launch.delay()?,
        last: None,
        ended: false,
        counters: StageCounters::default(),
    };
    // The history of the inputs may be in the queues already.
    flow.drain()?;
    loop {
        let woken = launch.signals.wait(
            &flow.inputs.listeners(),
            Some(flow.output.listener()),
            wake::MAX_WAIT,
        )?;
        flow.counters.wakes += 1;
        if woken.stop {
            flow.counters.duplicates = flow.inputs.duplicates();
            return Ok(flow.counters);
        }
        // A new reader receives the history.
        if woken.may_have_new_readers {
            flow.output.accept_readers()?;
        }
        // Items without a wake-up: the transport has lost an event.
        if flow.drain()? && woken.timed_out {
            flow.counters.wakes_caught_late += 1;
        }
    }
}

struct Flow<'a, S: Stage> {
    stage: &'a mut S,
    signals: &'a Signals,
    inputs: S::Inputs,
    output: Writer<S::Output>,
    delay: Duration,
    last: Option<u64>,
    ended: bool,
    counters: StageCounters,
}

impl<S: Stage> Flow<'_, S> {
    /// Processes all items in the queues; returns whether there were any.
    fn drain(&mut self) -> Result<bool, RunError> {
        let mut progressed = false;
        while !self.ended {
            match self.inputs.next_action()? {
                Action::Wait => break,
                Action::Keep => {}
                Action::Process(item, received_ns) => self.process(item, received_ns)?,
                Action::End(item) => self.end(item)?,
            }
            self.inputs.advance();
            progressed = true;
        }
        Ok(progressed)
    }

    fn process(&mut self, mut item: Item, received_ns: i64) -> Result<(), RunError> {
        self.require_next(&item)?;
        // A wait also writes the heartbeat, but the slowest stage always finds an item.
        self.signals.work_begins();
        let mut draft = self.output.loan()?;
        let missing = || RunError::transport("read the inputs of an item", item.seq);
        let view = self.inputs.view().ok_or_else(missing)?;
        let work = Work::begin();
        self.stage.process(view, &mut draft)?;
        if !self.delay.is_zero() {
            thread::sleep(self.delay);
        }
        *item.hop_mut(S::HOP) = Hop {
            received_ns,
            started_ns: work.started_ns,
            finished_ns: work.end(&mut self.counters),
            published_ns: 0,
        };
        self.stage.identify(&mut item);
        *draft.header().item_mut() = item;
        self.output.send(draft, S::HOP)
    }

    fn end(&mut self, item: Item) -> Result<(), RunError> {
        self.require_next(&item)?;
        self.ended = true;
        self.output.end(item, Some(S::HOP))
    }

    /// Requires consecutive output: a gap in its history would stop every reader that restarts on
    /// it.
    fn require_next(&mut self, item: &Item) -> Result<(), RunError> {
        match self
            .last
            .replace(item.seq)
            .map(|last| last.saturating_add(1))
        {
            Some(expected) if item.seq != expected => {
                Err(RunError::gap(S::Output::TOPIC, expected, item.seq))
            }
            _ => Ok(()),
        }
    }
}
