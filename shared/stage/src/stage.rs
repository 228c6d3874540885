//! The loop of a stage between source and sink.

use gyre_messages::{Header, Item, Message, flag};

use crate::{
    Launch, StageCounters, StageError, allocations, clock,
    inputs::{Inputs, Turn},
    wake,
    writer::{Draft, Writer},
};

/// A stage: a function of its inputs. Waiting, joining, publishing and restarting are this crate's.
pub trait Stage {
    /// The inputs that it waits for.
    type Inputs: Inputs;
    /// The message that it publishes.
    type Output: Message;
    /// Which of the processes it is, or replaces.
    const HOP: gyre_messages::StageId;

    /// Processes one item: reads borrowed shared memory and writes header and payload of a loaned sample. The header's
    /// item is filled in afterwards.
    ///
    /// # Errors
    /// What ends the process; its exit code tells the supervisor whether a restart can help.
    fn process(
        &mut self,
        input: <Self::Inputs as Inputs>::View<'_>,
        output: &mut Draft<Self::Output>,
    ) -> Result<(), StageError>;
}

/// Runs a stage until SIGTERM.
pub fn run<S: Stage>(launch: &Launch, stage: &mut S) -> Result<StageCounters, StageError> {
    let inputs = S::Inputs::open(launch)?;
    let output = Writer::open(&launch.node, &launch.manifest)?;
    let mut flow = Flow {
        stage,
        inputs,
        output,
        last_sent: None,
        ended: false,
        counters: StageCounters::default(),
    };
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
        if woken.may_have_new_readers() {
            flow.output.accept_readers()?;
        }
        if flow.drain()? && woken.timed_out {
            flow.counters.wakes_caught_late += 1;
        }
    }
}

struct Flow<'a, S: Stage> {
    stage: &'a mut S,
    inputs: S::Inputs,
    output: Writer<S::Output>,
    last_sent: Option<u64>,
    ended: bool,
    counters: StageCounters,
}

impl<S: Stage> Flow<'_, S> {
    /// Processes all that has come; returns whether there was anything.
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
        self.require_next(&item)?;
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
        self.counters.record(allocated, finished_ns - started_ns);
        self.send(item.seq, draft)
    }

    fn end(&mut self, item: Item) -> Result<(), StageError> {
        self.require_next(&item)?;
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

    /// Requires that the output is consecutive: a gap in its history would end each reader that is restarted on it.
    fn require_next(&self, item: &Item) -> Result<(), StageError> {
        match self.last_sent.map(|last| last.saturating_add(1)) {
            Some(expected) if item.seq != expected => Err(StageError::SequenceGap {
                topic: S::Output::TOPIC,
                expected,
                got: item.seq,
            }),
            _ => Ok(()),
        }
    }
}
