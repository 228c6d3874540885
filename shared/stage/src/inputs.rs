//! The inputs of a stage: pairs of consecutive items, alone or joined with another topic.

use gyre_messages::{Item, Masked, Message, Pair, flag};

use crate::{
    Launch, StageError,
    reader::{Reader, Received},
    services::Listener,
};

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Something is missing: sleep until it comes.
    Wait,
    /// The item at hand serves only as the one before: step past it and send nothing.
    Keep,
    /// All is there: work on this item, which was complete at the given time (`CLOCK_MONOTONIC`, ns).
    Process(Item, i64),
    /// The stream ends here: pass it on.
    End(Item),
}

/// The inputs of a stage.
pub trait Inputs: Sized {
    /// What `process` sees.
    type View<'a>
    where
        Self: 'a;

    /// Opens them.
    ///
    /// # Errors
    /// A failure of the transport.
    fn open(launch: &Launch) -> Result<Self, StageError>;
    /// Takes what has come and says what to do next.
    ///
    /// # Errors
    /// A failure of the transport, a missing item.
    fn turn(&mut self) -> Result<Turn, StageError>;
    /// The inputs of the item that [`Turn::Process`] named.
    fn view(&self) -> Option<Self::View<'_>>;
    /// Steps to the next item.
    fn advance(&mut self);
    /// What the publishers notify.
    fn listeners(&self) -> Vec<&Listener>;
    /// Items skipped because they had been received before.
    fn duplicates(&self) -> u64;
}

/// Two consecutive items of one topic.
pub struct Pairs<M: Message> {
    reader: Reader<M>,
}

/// See [`Pairs`].
pub struct PairView<'a, M: Message> {
    /// The current item.
    pub current: &'a Received<M>,
    /// The one before; `None` where the chain starts.
    pub before: Option<&'a Received<M>>,
}

impl<M: Message> PairView<'_, M> {
    /// Time between the two scans, ns on the sensor's clock; 0 where the chain starts.
    pub fn interval_ns(&self) -> i64 {
        let stamp_ns = self.current.item().stamp_ns;
        self.before
            .map_or(0, |before| stamp_ns.saturating_sub(before.item().stamp_ns))
    }
}

impl PairView<'_, Masked> {
    /// The rasters to match.
    ///
    /// # Errors
    /// A payload that is shorter than its header says.
    pub fn rasters(&self) -> Result<Pair<'_>, StageError> {
        let before = self.before.map(|before| (before.header(), before.values()));
        let pair = self.current.header().pair(self.current.values(), before);
        pair.ok_or_else(|| {
            self.current
                .malformed("its rasters do not fit their headers")
        })
    }
}

impl<M: Message> Inputs for Pairs<M> {
    type View<'a> = PairView<'a, M>;

    fn open(launch: &Launch) -> Result<Self, StageError> {
        Ok(Self {
            reader: Reader::open(launch, None)?,
        })
    }

    fn turn(&mut self) -> Result<Turn, StageError> {
        let Some(head) = self.reader.head()? else {
            return Ok(Turn::Wait);
        };
        let (item, received_ns) = (*head.item(), head.received_ns);
        Ok(turn_of(&item, self.reader.before().is_some(), received_ns))
    }

    fn view(&self) -> Option<PairView<'_, M>> {
        Some(PairView {
            current: self.reader.current()?,
            before: self.reader.before(),
        })
    }

    fn advance(&mut self) {
        self.reader.advance();
    }

    fn listeners(&self) -> Vec<&Listener> {
        vec![self.reader.listener()]
    }

    fn duplicates(&self) -> u64 {
        self.reader.duplicates()
    }
}

/// Two consecutive items of one topic, and the item of another topic that belongs to the later one.
pub struct Joined<A: Message, B: Message> {
    pairs: Reader<A>,
    other: Reader<B>,
}

/// See [`Joined`].
pub struct JoinedView<'a, A: Message, B: Message> {
    /// The current item of the first topic and the one before.
    pub pair: PairView<'a, A>,
    /// The other topic's message for the current item.
    pub other: &'a Received<B>,
}

impl<A: Message, B: Message> Inputs for Joined<A, B> {
    type View<'a> = JoinedView<'a, A, B>;

    fn open(launch: &Launch) -> Result<Self, StageError> {
        Ok(Self {
            pairs: Reader::open(launch, None)?,
            other: Reader::open(launch, None)?,
        })
    }

    fn turn(&mut self) -> Result<Turn, StageError> {
        loop {
            let (Some(a), Some(b)) = (self.pairs.head()?, self.other.head()?) else {
                return Ok(Turn::Wait);
            };
            let (item, other) = (*a.item(), *b.item());
            let received_ns = a.received_ns.max(b.received_ns);
            if item.seq < other.seq {
                return Ok(Turn::Keep);
            }
            if item.seq == other.seq {
                // The later input has all stamps so far.
                let item = Item {
                    hops: other.hops,
                    ..item
                };
                return Ok(turn_of(&item, self.pairs.before().is_some(), received_ns));
            }
            // After a restart the other topic's history may reach further back; its items alone are of no use.
            self.other.release();
        }
    }

    fn view(&self) -> Option<JoinedView<'_, A, B>> {
        Some(JoinedView {
            pair: PairView {
                current: self.pairs.current()?,
                before: self.pairs.before(),
            },
            other: self.other.current()?,
        })
    }

    fn advance(&mut self) {
        let together = match (self.pairs.current(), self.other.current()) {
            (Some(a), Some(b)) => a.item().seq == b.item().seq,
            _ => false,
        };
        self.pairs.advance();
        if together {
            self.other.release();
        }
    }

    fn listeners(&self) -> Vec<&Listener> {
        vec![self.pairs.listener(), self.other.listener()]
    }

    fn duplicates(&self) -> u64 {
        self.pairs.duplicates() + self.other.duplicates()
    }
}

/// The first item can be worked on only with the one before it, unless the chain starts there.
fn turn_of(item: &Item, has_before: bool, received_ns: i64) -> Turn {
    match () {
        () if item.is(flag::END) => Turn::End(*item),
        () if has_before || item.is(flag::BREAK) => Turn::Process(*item, received_ns),
        () => Turn::Keep,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_item_without_the_one_before_is_only_kept_unless_the_chain_starts_there() {
        let item = Item {
            seq: 7,
            ..Item::default()
        };
        assert_eq!(turn_of(&item, false, 1), Turn::Keep);
        assert_eq!(turn_of(&item, true, 1), Turn::Process(item, 1));
        let start = Item {
            flags: flag::BREAK,
            ..item
        };
        assert_eq!(turn_of(&start, false, 1), Turn::Process(start, 1));
        let end = Item {
            flags: flag::END,
            ..item
        };
        assert_eq!(turn_of(&end, true, 1), Turn::End(end));
    }
}
