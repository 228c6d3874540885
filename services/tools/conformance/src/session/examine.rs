//! What must hold for each item that a process sends.

use gyre_messages::{Item, flag};
use gyre_supervise::rig::Recorded;

use super::Session;
use crate::{
    copying::{not_copied, wrong_stamps},
    rule::Rule,
};

impl Session<'_> {
    /// Examines one item that the process has sent, alone and after the one before.
    pub(super) fn examine(&mut self, output: &Recorded) {
        let item = output.item();
        let pid = item.pid;
        let is_own = self.process.as_ref().is_some_and(|it| it.has(pid));
        // The last items of one that has just ended are looked at after its end.
        let has_ended = self.process.as_mut().is_none_or(|it| it.death().is_some());
        self.findings
            .require(Rule::StampsWork, is_own || has_ended, || {
                format!(
                    "item {} names the process {pid}, which is none of the command's",
                    item.seq
                )
            });
        if item.is(flag::BASE) {
            return;
        }
        let expected = self.last.map(|last| last + 1);
        self.findings.require(
            Rule::OneForOne,
            expected.is_none_or(|expected| item.seq == expected),
            || out_of_order(item.seq, expected.unwrap_or_default()),
        );
        self.last = Some(item.seq);
        self.examine_copy(&item);
        if !item.is(flag::END) {
            self.examine_stamps(&item, output.received_ns);
        }
    }

    fn examine_copy(&mut self, item: &Item) {
        let Some(copied) = self.ports.copied() else {
            return;
        };
        let Some(input) = self.tape.get(copied, item.seq).map(Recorded::item) else {
            let sentence = format!("it sent item {}, which no input has", item.seq);
            self.findings.broken(Rule::OneForOne, sentence);
            return;
        };
        self.findings.checked(Rule::CopiesItem);
        for field in not_copied(self.subject.stage, &input, item) {
            let sentence = format!(
                "item {}: {field} is not that of the input on `{copied}`",
                item.seq
            );
            self.findings.broken(Rule::CopiesItem, sentence);
        }
    }

    fn examine_stamps(&mut self, item: &Item, read_ns: i64) {
        // The poses of an earlier life are sent with its stamps.
        let is_first = self.about(item.seq).next().is_none();
        let sent_ns = self.sent_ns.get(&item.seq).copied().filter(|_| is_first);
        self.findings.checked(Rule::StampsWork);
        if let Some(sentence) = wrong_stamps(self.subject.stage, item, sent_ns, read_ns) {
            self.findings.broken(Rule::StampsWork, sentence);
        }
    }
}

fn out_of_order(seq: u64, expected: u64) -> String {
    let before = expected.saturating_sub(1);
    match seq > expected {
        true => format!("it sent item {seq} after item {before}: {expected} is missing"),
        false => {
            format!("it sent item {seq} after item {before}: it is a duplicate or out of order")
        }
    }
}
