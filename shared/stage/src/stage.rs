//! The loop of a stage in the middle of the stream.

use gyre_messages::{Header, Item, Message, flag};

use crate::{
    Launch, StageError, Statistics, allocations, clock,
    inputs::{Inputs, Turn},
    wake,
    writer::{Draft, Writer},
};

/// A stage: a function of its inputs. All else is this crate's business.
pub trait Stage {
    /// What it waits for.
    type Inputs: Inputs;
    /// What it sends.
    type Output: Message;
    /// Which of the processes it is, or stands in for.
    const HOP: gyre_messages::Stage;

    /// Works on borrowed shared memory and writes into a loaned sample: header (but its item) and payload.
    fn process(
        &mut self,
        input: <Self::Inputs as Inputs>::View<'_>,
        output: &mut Draft<Self::Output>,
    ) -> Result<(), StageError>;
}

/// Runs a stage until SIGTERM.
pub fn run<S: Stage>(launch: &Launch, stage: &mut S) -> Result<Statistics, StageError> {
    let inputs = S::Inputs::open(launch)?;
    let output = Writer::open(&launch.node, &launch.manifest)?;
    let mut flow = Flow {
        stage,
        inputs,
        output,
        last_sent: None,
        ended: false,
        statistics: Statistics::default(),
    };
    flow.drain()?;
    loop {
        let woken = launch.signals.wait(
            &flow.inputs.listeners(),
            Some(flow.output.listener()),
            wake::NET,
        )?;
        flow.statistics.wakes += 1;
        if woken.stop {
            flow.statistics.duplicates = flow.inputs.duplicates();
            return Ok(flow.statistics);
        }
        if woken.may_have_newcomers() {
            flow.output.greet()?;
        }
        if flow.drain()? && woken.timed_out {
            flow.statistics.wakes_caught_late += 1;
        }
    }
}

struct Flow<'a, S: Stage> {
    stage: &'a mut S,
    inputs: S::Inputs,
    output: Writer<S::Output>,
    last_sent: Option<u64>,
    ended: bool,
    statistics: Statistics,
}

impl<S: Stage> Flow<'_, S> {
    /// Does all that can be done now; returns whether that was anything.
    fn drain(&mut self) -> Result<bool, StageError> {
        let mut progressed = false;
        while !self.ended {
            match self.inputs.turn()? {
                Turn::Wait => break,
                Turn::Keep => {}
                Turn::Process(item, received_ns) => self.process(item, received_ns)?,
                Turn::End(item) => self.end(item)?,
            }
            self.inputs.advance();
            progressed = true;
        }
        Ok(progressed)
    }

    fn process(&mut self, mut item: Item, received_ns: i64) -> Result<(), StageError> {
        self.promise(&item)?;
        let mut draft = self.output.loan()?;
        let Some(view) = self.inputs.view() else {
            return Ok(());
        };
        let (started_ns, allocated) = (clock::now_ns(), allocations::so_far());
        self.stage.process(view, &mut draft)?;
        let (finished_ns, allocated) = (clock::now_ns(), allocations::so_far() - allocated);
        *item.hop(S::HOP) = gyre_messages::Hop {
            received_ns,
            started_ns,
            finished_ns,
            published_ns: 0,
        };
        *draft.header().item_mut() = item;
        self.statistics.record(allocated, finished_ns - started_ns);
        self.send(item.seq, draft)
    }

    fn end(&mut self, item: Item) -> Result<(), StageError> {
        self.promise(&item)?;
        self.ended = true;
        let mut draft = self.output.loan()?;
        *draft.header().item_mut() = Item {
            flags: flag::END,
            ..item
        };
        self.send(item.seq, draft)
    }

    fn send(&mut self, seq: u64, draft: Draft<S::Output>) -> Result<(), StageError> {
        self.output.send(draft, S::HOP)?;
        self.last_sent = Some(seq);
        Ok(())
    }

    /// What a stage sends is consecutive: a hole in its history would kill each reader that is restarted on it.
    fn promise(&self, item: &Item) -> Result<(), StageError> {
        match self.last_sent.map(|last| last.saturating_add(1)) {
            Some(expected) if item.seq != expected => Err(StageError::BrokenPromise {
                topic: S::Output::TOPIC,
                expected,
                got: item.seq,
            }),
            _ => Ok(()),
        }
    }
}
