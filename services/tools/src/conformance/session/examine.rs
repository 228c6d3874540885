//! The checks of each item that a process sends.

use gyre_messages::{Item, flag};
use gyre_supervise::rig::Recorded;

use super::Session;
use crate::conformance::{
    item::{not_copied, wrong_stamps},
    rule::Rule,
};

impl Session<'_> {
    /// Examines one item that the process has sent, alone and after the one before.
    pub(super) fn examine(&mut self, output: &Recorded) {
        let item = output.item();
        if item.is(flag::BASE) {
            return;
        }
        if let Some(last) = self.last {
            let follows = item.seq == last + 1;
            self.findings.require(Rule::OneForOne, follows, || {
                let reason = match item.seq > last {
                    true => format!("{} is missing", last + 1),
                    false => "it is a duplicate or out of order".to_owned(),
                };
                format!("it sent item {} after item {last}: {reason}", item.seq)
            });
        }
        self.findings.checked(Rule::OneForOne);
        self.last = Some(item.seq);
        self.examine_copy(&item);
        if !item.is(flag::END) {
            self.examine_stamps(&item, output.received_ns);
        }
    }

    fn examine_copy(&mut self, item: &Item) {
        let Some(copied) = self.harness.topics.copied() else {
            return;
        };
        let Some(input) = self.reference.get(copied, item.seq).map(Recorded::item) else {
            let sentence = format!("it sent item {}, which no input has", item.seq);
            self.findings.broken(Rule::OneForOne, sentence);
            return;
        };
        self.findings.checked(Rule::CopiesItem);
        for field in not_copied(self.stage(), &input, item) {
            let sentence = format!(
                "item {}: {field} is not that of the input on `{copied}`",
                item.seq
            );
            self.findings.broken(Rule::CopiesItem, sentence);
        }
    }

    fn examine_stamps(&mut self, item: &Item, read_ns: i64) {
        // The poses of an earlier life are sent with its stamps.
        let is_first = !self.has(item.seq);
        let sent_ns = self.sent_ns.get(&item.seq).copied().filter(|_| is_first);
        self.findings.checked(Rule::StampsWork);
        if let Some(sentence) = wrong_stamps(self.stage(), item, sent_ns, read_ns) {
            self.findings.broken(Rule::StampsWork, sentence);
        }
    }
}
