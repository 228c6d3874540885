//! Renumbers an observed item, and sends it to the shadow.
//!
//! The shadow's numbers are consecutive, as the contract demands, also where the observed numbers
//! are not: after a gap, or skipped items. Such an item *opens* the stream again, and its result is
//! not compared:
//!
//! - to a search it is the start of a chain (BREAK), so that the next item is matched against it
//!   and not against an older one;
//! - masking looks up motions by number: it gets each motion with that number, directly before the
//!   scan;
//! - refinement needs the state before its first item, because each life begins with that state: it
//!   is started again.

use gyre_client::RunError;
use gyre_contract::{Item, Message, Motion, Pose, StageId, flag};

use super::observation::{Feedback, Observed};
use crate::conformance::harness::{Harness, start_of_trajectory};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Renumbering {
    stage: StageId,
    lag: u64,
    /// The numbers of the last item in the run and for the shadow.
    last: Option<(u64, u64)>,
    /// The shadow's number of the last item that began a chain of motions.
    broken_at: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Entry {
    Continues,
    Opens,
    /// It is left out: its result depends on items before, which were not seen.
    IsLeftOut,
    /// It needs a shadow that has had no other item.
    NeedsNewLife,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SentItem {
    pub item: Item,
    /// True if the item is one that only opens the stream.
    pub opens: bool,
    /// True if it has to be answered. One without the item before it need not be.
    pub is_answered: bool,
}

impl Renumbering {
    pub(crate) fn new(stage: StageId, lag: usize) -> Self {
        Self {
            stage,
            lag: lag as u64,
            last: None,
            broken_at: None,
        }
    }

    pub(crate) fn entry(&self, observed: &Observed) -> Entry {
        match self.last {
            Some((run, _)) if run.checked_add(1) == Some(observed.seq()) => Entry::Continues,
            Some((_, number)) if !self.can_jump(number) => Entry::NeedsNewLife,
            _ if observed.can_open => Entry::Opens,
            _ => Entry::IsLeftOut,
        }
    }

    /// Returns whether an item that does not follow can come after the one of this number.
    fn can_jump(&self, last: u64) -> bool {
        match self.stage {
            StageId::Refinement => false,
            // Masking takes the motions over a start of the chain for none, whatever they are.
            StageId::Masking => self.broken_at.is_none_or(|start| last - start >= self.lag),
            _ => true,
        }
    }

    pub(crate) fn send(
        &mut self,
        shadow: &Harness<'_>,
        observed: &Observed,
    ) -> Result<SentItem, RunError> {
        let opens = self.entry(observed) != Entry::Continues;
        let run = observed.seq();
        let number = self.last.map_or(run, |(_, number)| number + 1);
        if self.stage == StageId::Masking {
            self.send_motions(shadow, observed, number)?;
        }
        let mut item = Item {
            seq: number,
            ..observed.output.item()
        };
        let is_search = !matches!(self.stage, StageId::Masking | StageId::Refinement);
        if opens && is_search {
            (item.flags, item.previous_scan) = (item.flags | flag::BREAK, item.scan);
        }
        for (topic, input) in &observed.inputs {
            item = Item {
                seq: item.seq,
                scan: item.scan,
                previous_scan: item.previous_scan,
                flags: item.flags,
                generation: 0,
                numbered_from: 0,
                ..input.item()
            };
            shadow.feed(topic, &input.about(&item))?;
        }
        self.last = Some((run, number));
        if observed.breaks() {
            self.broken_at = Some(number);
        }
        Ok(SentItem {
            item,
            opens: opens && !observed.breaks(),
            is_answered: !opens || item.is(flag::BREAK),
        })
    }

    /// Sends the motions and poses that masking needs for an item.
    fn send_motions(
        &self,
        shadow: &Harness<'_>,
        observed: &Observed,
        number: u64,
    ) -> Result<(), RunError> {
        if self.last.is_none() {
            return send_start(shadow, observed);
        }
        let run = observed.seq();
        let is_lagged = |it: &&Feedback| it.pose.item().seq.checked_add(self.lag) == Some(run);
        let mut before = observed.before.iter().filter(|_| self.lag > 0);
        let Some(lagged) = before.find(is_lagged) else {
            return Ok(());
        };
        for (topic, message) in [(Motion::TOPIC, &lagged.motion), (Pose::TOPIC, &lagged.pose)] {
            let mut item = message.item();
            (item.seq, item.generation, item.numbered_from) = (number - self.lag, 0, 0);
            item.flags &= !flag::SYNC;
            shadow.feed(topic, &message.about(&item))?;
        }
        Ok(())
    }
}

/// Sends the history that masking finds when it starts: the newest pose, and the motions before.
fn send_start(shadow: &Harness<'_>, observed: &Observed) -> Result<(), RunError> {
    for before in &observed.before {
        shadow.feed(Motion::TOPIC, &before.motion)?;
    }
    let Some(newest) = observed.before.last() else {
        return shadow.feed(Pose::TOPIC, &start_of_trajectory());
    };
    let mut item = newest.pose.item();
    item.flags |= flag::SYNC;
    shadow.feed(Pose::TOPIC, &newest.pose.about(&item))
}

#[cfg(test)]
mod tests {
    use gyre_contract::{Masked, MaskedHeader};
    use gyre_supervise::rig::Recorded;

    use super::*;

    fn item(seq: u64, can_open: bool) -> Observed {
        let mut header = MaskedHeader::default();
        header.item.seq = seq;
        Observed {
            inputs: Vec::new(),
            output: Recorded::of::<Masked>(&header, &[], 0),
            before: Vec::new(),
            can_open,
        }
    }

    /// Masking does not jump within the lag of a break, and refinement does not jump.
    #[test]
    fn a_stream_is_opened_where_the_results_depend_on_nothing_that_was_not_seen() {
        use Entry::{Continues, IsLeftOut, NeedsNewLife, Opens};
        use StageId::{Masking, Refinement, RotationSearch};
        let begun = Some((7, 5));
        for (stage, last, broken_at, (seq, can_open), entry) in [
            (Masking, None, None, (7, false), IsLeftOut),
            (Masking, None, None, (7, true), Opens),
            (Masking, begun, None, (8, false), Continues),
            (Masking, begun, None, (9, true), Opens),
            (Masking, begun, Some(4), (20, true), NeedsNewLife),
            (Masking, begun, Some(3), (20, true), Opens),
            (RotationSearch, begun, Some(5), (20, true), Opens),
            (Refinement, begun, Some(0), (20, true), NeedsNewLife),
        ] {
            let stream = Renumbering {
                last,
                broken_at,
                ..Renumbering::new(stage, 2)
            };
            let found = stream.entry(&item(seq, can_open));
            assert_eq!(found, entry, "{stream:?}");
        }
    }
}
