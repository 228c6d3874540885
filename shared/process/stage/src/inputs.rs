//! The inputs of a stage: pairs of consecutive items of one topic, alone or joined with another
//! topic. A [`Reader`] subscribes to one topic, checks its messages and leaves out duplicates: its
//! head is the next item, and it keeps the item before.

use gyre_contract::{Item, Masked, Message, Pair, flag};

use crate::Launch;
use gyre_transport::{
    RunError,
    reader::{Reader, Received},
    transport::Listener,
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Wait: an input is missing.
    Wait,
    /// Keep the current item only as the previous one of the next: advance and publish nothing.
    Keep,
    /// Process this item, whose last input was received at the given time (`CLOCK_MONOTONIC`, ns).
    Process(Item, i64),
    End(Item),
}

pub trait Inputs: Sized {
    type View<'a>
    where
        Self: 'a;

    fn open(launch: &Launch) -> Result<Self, RunError>;
    fn next_action(&mut self) -> Result<Action, RunError>;
    /// Returns the inputs of the item of [`Action::Process`].
    fn view(&self) -> Option<Self::View<'_>>;
    fn advance(&mut self);
    /// Returns the listeners to wait for after [`Action::Wait`]. If two inputs are missing, only
    /// the later one is waited for: fewer wake-ups leave processor time to the stages before.
    fn listeners(&self) -> Vec<&Listener>;
    /// Returns the number of items that were skipped because they had been received before.
    fn duplicates(&self) -> u64;
}

/// Two consecutive items of one topic.
pub type Pairs<M> = Reader<M>;

pub struct PairView<'a, M: Message> {
    pub current: &'a Received<M>,
    /// The previous item; `None` where the chain starts.
    pub previous: Option<&'a Received<M>>,
}

impl<M: Message> PairView<'_, M> {
    /// Returns the time between the two scans, ns on the sensor's clock; 0 where the chain starts.
    pub fn interval_ns(&self) -> i64 {
        let stamp_ns = |received: &Received<M>| received.item().stamp_ns;
        self.previous.map_or(0, |previous| {
            stamp_ns(self.current).saturating_sub(stamp_ns(previous))
        })
    }
}

impl PairView<'_, Masked> {
    pub fn rasters(&self) -> Result<Pair<'_>, RunError> {
        let previous = self.previous.map(|it| (it.header(), it.values()));
        let pair = self.current.header().pair(self.current.values(), previous);
        let malformed = || {
            self.current
                .malformed("its rasters do not fit their headers")
        };
        pair.ok_or_else(malformed)
    }
}

impl<M: Message> Inputs for Reader<M> {
    type View<'a> = PairView<'a, M>;

    fn open(launch: &Launch) -> Result<Self, RunError> {
        launch.reader(None)
    }

    fn next_action(&mut self) -> Result<Action, RunError> {
        let Some(head) = self.head()? else {
            return Ok(Action::Wait);
        };
        let (item, received_ns) = (*head.item(), head.received_ns);
        let has_previous = self.previous().is_some();
        Ok(action_for(&item, has_previous, received_ns))
    }

    fn view(&self) -> Option<PairView<'_, M>> {
        Some(PairView {
            current: self.current()?,
            previous: self.previous(),
        })
    }

    fn advance(&mut self) {
        Self::advance(self);
    }

    fn listeners(&self) -> Vec<&Listener> {
        vec![self.listener()]
    }

    fn duplicates(&self) -> u64 {
        self.duplicates
    }
}

/// Two consecutive items of one topic, and the item of another topic for the later one.
pub struct Joined<A: Message, B: Message> {
    pairs: Pairs<A>,
    other: Reader<B>,
}

pub struct JoinedView<'a, A: Message, B: Message> {
    pub pair: PairView<'a, A>,
    pub other: &'a Received<B>,
}

impl<A: Message, B: Message> Inputs for Joined<A, B> {
    type View<'a> = JoinedView<'a, A, B>;

    fn open(launch: &Launch) -> Result<Self, RunError> {
        Ok(Self {
            pairs: launch.reader(None)?,
            other: launch.reader(None)?,
        })
    }

    fn next_action(&mut self) -> Result<Action, RunError> {
        loop {
            let (Some(a), Some(b)) = (self.pairs.head()?, self.other.head()?) else {
                return Ok(Action::Wait);
            };
            let (item, other) = (*a.item(), *b.item());
            let received_ns = a.received_ns.max(b.received_ns);
            if item.seq < other.seq {
                return Ok(Action::Keep);
            }
            if item.seq == other.seq {
                // The message from further down the stream has more time stamps.
                let item = Item {
                    hops: other.hops,
                    ..item
                };
                let has_previous = self.pairs.previous().is_some();
                return Ok(action_for(&item, has_previous, received_ns));
            }
            // After a restart the history of the other topic may reach further back; its items are
            // of no use alone.
            self.other.release();
        }
    }

    fn view(&self) -> Option<JoinedView<'_, A, B>> {
        Some(JoinedView {
            pair: self.pairs.view()?,
            other: self.other.current()?,
        })
    }

    fn advance(&mut self) {
        let seq = self.pairs.current().map(|it| it.item().seq);
        self.pairs.advance();
        if seq.is_some() && seq == self.other.current().map(|it| it.item().seq) {
            self.other.release();
        }
    }

    fn listeners(&self) -> Vec<&Listener> {
        // The other topic is further down the stream.
        vec![match self.other.current() {
            None => self.other.listener(),
            Some(_) => self.pairs.listener(),
        }]
    }

    fn duplicates(&self) -> u64 {
        self.pairs.duplicates + self.other.duplicates
    }
}

/// An item can be processed only with the previous one, unless the chain starts there.
fn action_for(item: &Item, has_previous: bool, received_ns: i64) -> Action {
    match () {
        () if item.is(flag::END) => Action::End(*item),
        () if has_previous || item.is(flag::BREAK) => Action::Process(*item, received_ns),
        () => Action::Keep,
    }
}
