//! The messages of the shadow: examined against the contract, and compared with the result of the
//! run for the same item.

use gyre_configuration::terminal::Failure;
use gyre_contract::{Item, flag};
use gyre_supervise::rig::Recorded;

use super::{Shadowing, UnderWay};
use crate::conformance::{
    harness::Sent,
    item::{not_copied, wrong_stamps},
};

impl Shadowing<'_> {
    pub(super) fn receive(&mut self, sent: Sent) -> Result<(), Failure> {
        let output = match sent {
            Sent::Message(output) => output,
            Sent::Malformed { sentence, .. } => {
                self.breach(sentence);
                self.record.counts.unanswered += u64::from(self.under_way.take().is_some());
                return Ok(());
            }
        };
        let item = output.item();
        match self.under_way.take() {
            Some(it) if it.sent.item.seq == item.seq && !item.is(flag::END) => {
                self.unanswerable = None;
                return self.answered(&it, &output);
            }
            before => self.under_way = before,
        }
        match self.unanswerable.take() {
            Some(seq) if seq == item.seq && !item.is(flag::END) => {}
            unasked => {
                self.unanswerable = unasked;
                let owed = match &self.under_way {
                    Some(it) => format!("item {}", it.sent.item.seq),
                    None => "none".to_owned(),
                };
                let seq = item.seq;
                self.breach(format!("it sent item {seq}, and {owed} was to be answered"));
            }
        }
        Ok(())
    }

    fn answered(&mut self, it: &UnderWay, output: &Recorded) -> Result<(), Failure> {
        let stage = self.program.candidate.stage;
        let (item, sent) = (output.item(), &it.sent.item);
        for field in not_copied(stage, sent, &item) {
            let seq = it.observed.seq();
            self.breach(format!("item {seq}: {field} is not that of its input"));
        }
        let wrong = wrong_stamps(stage, &item, Some(it.sent_ns), output.received_ns);
        let has_stamps = wrong.is_none();
        wrong.into_iter().for_each(|sentence| self.breach(sentence));
        if it.sent.opens {
            self.record.counts.opening += 1;
            return Ok(());
        }
        self.failures = 0;
        let answered_ns = match has_stamps {
            true => item.hops[stage as usize].published_ns,
            false => output.received_ns,
        };
        let as_observed = Item {
            seq: it.observed.seq(),
            ..item
        };
        let answer_ns = it.is_timed.then_some(answered_ns - it.sent_ns);
        let shadow = output.about(&as_observed);
        self.record.compare(&it.observed.output, &shadow, answer_ns)
    }

    fn breach(&mut self, sentence: String) {
        if self.record.counts.breaches == 0 {
            self.lines
                .push(format!("it breaks the contract: {sentence}"));
        }
        self.record.breach(sentence);
    }
}
