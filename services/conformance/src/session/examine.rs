//! What must hold for each item that a process sends.

use gyre_messages::{Item, flag};
use gyre_stage::supervise::rig::Recorded;

use super::Session;
use crate::rule::Rule;

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
        let mut hops = item.hops;
        hops[self.subject.stage as usize] = input.hops[self.subject.stage as usize];
        let passes_flags = item.flags & !(flag::SYNC) == input.flags & !(flag::SYNC);
        let fields = [
            ("scan", item.scan == input.scan),
            ("previous_scan", item.previous_scan == input.previous_scan),
            ("published", item.published == input.published),
            ("stamp_ns", item.stamp_ns == input.stamp_ns),
            ("due_ns", item.due_ns == input.due_ns),
            ("flags", passes_flags),
            ("hops (the stamps of the stages before)", hops == input.hops),
        ];
        for (field, holds) in fields {
            self.findings.require(Rule::CopiesItem, holds, || {
                format!(
                    "item {}: {field} is not that of the input on `{copied}`",
                    item.seq
                )
            });
        }
    }

    fn examine_stamps(&mut self, item: &Item, read_ns: i64) {
        let hop = item.hops[self.subject.stage as usize];
        let stamps = [
            ("received_ns", hop.received_ns),
            ("started_ns", hop.started_ns),
            ("finished_ns", hop.finished_ns),
            ("published_ns", hop.published_ns),
        ];
        let seq = item.seq;
        if let Some((name, _)) = stamps.iter().find(|(_, stamp)| *stamp == 0) {
            let sentence = format!("item {seq}: {name} of its own hop is 0");
            self.findings.broken(Rule::StampsWork, sentence);
            return;
        }
        for pair in stamps.windows(2) {
            self.findings
                .require(Rule::StampsWork, pair[0].1 <= pair[1].1, || {
                    format!("item {seq}: {} is after {}", pair[0].0, pair[1].0)
                });
        }
        // The poses of an earlier life are sent with its stamps.
        let is_first = self.about(seq).next().is_none();
        let sent_ns = self.sent_ns.get(&seq).copied().filter(|_| is_first);
        self.findings.require(
            Rule::StampsWork,
            hop.published_ns <= read_ns && sent_ns.is_none_or(|sent| hop.received_ns >= sent),
            || format!("item {seq}: its stamps are not between those of its input and of its reader; they are to be CLOCK_MONOTONIC, ns"),
        );
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
