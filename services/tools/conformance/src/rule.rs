//! The rules that are checked, and what was found.

use std::{collections::BTreeMap, fmt};

use serde::Serialize;

/// A rule of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// It opens its topics and creates none.
    CreatesNothing,
    /// It has opened the topic that it publishes before the start timeout.
    StartsInTime,
    /// It notifies the publishers of its inputs.
    AsksForHistory,
    /// It answers the handshake of a new reader with its history.
    GivesHistory,
    /// Readers that come and go, and one that never reads, change nothing.
    IgnoresObservers,
    /// One item for each input item, with consecutive numbers.
    OneForOne,
    /// The item is the input's.
    CopiesItem,
    /// Its own time stamps are filled in, and in order; the process id is its own.
    StampsWork,
    /// The fields of what it sends keep their rules.
    SendsValid,
    /// It needs no earlier item but the previous one.
    LooksBack,
    /// The same inputs give the same outputs.
    Deterministic,
    /// Killed and started again, it goes on without a gap.
    Resumes,
    /// Masking: it waits for the motion of the item `lag` before, and for no later one, from either topic.
    WaitsForMotion,
    /// The source: it sends no more items than the window admits.
    KeepsWindow,
    /// The sink: it starts with the newest pose, or says that there is none.
    BeginsWithNewest,
    /// It passes on the end of the stream, and goes on living.
    PassesEnd,
    /// It exits with code 0 on SIGTERM.
    StopsOnRequest,
    /// Told to stand by, it says that it does, opens nothing before it may, and then takes over.
    StandsBy,
    /// It refuses inputs that break the contract.
    RefusesMalformed,
    /// Its results are those of Gyre's own stage, to the bit.
    SameAsOwn,
    /// It works within the budget.
    KeepsBudget,
}

impl Rule {
    /// All rules, in the order of the contract.
    pub const ALL: [Self; 21] = [
        Self::CreatesNothing,
        Self::StartsInTime,
        Self::AsksForHistory,
        Self::GivesHistory,
        Self::IgnoresObservers,
        Self::OneForOne,
        Self::CopiesItem,
        Self::StampsWork,
        Self::LooksBack,
        Self::Deterministic,
        Self::Resumes,
        Self::WaitsForMotion,
        Self::KeepsWindow,
        Self::BeginsWithNewest,
        Self::PassesEnd,
        Self::StopsOnRequest,
        Self::StandsBy,
        Self::SendsValid,
        Self::RefusesMalformed,
        Self::SameAsOwn,
        Self::KeepsBudget,
    ];

    /// Returns what a program that keeps it does.
    pub fn says(self) -> &'static str {
        match self {
            Self::CreatesNothing => "opens its topics and creates none",
            Self::StartsInTime => "has opened its topics in time",
            Self::AsksForHistory => "joins by the subscribe handshake",
            Self::GivesHistory => "gives a late reader its history",
            Self::IgnoresObservers => "is not disturbed by observers",
            Self::OneForOne => "sends one item for each, with consecutive numbers",
            Self::CopiesItem => "copies the item of its input",
            Self::StampsWork => "fills in its own time stamps and process id",
            Self::LooksBack => "needs no earlier item but the previous one",
            Self::Deterministic => "gives the same outputs for the same inputs",
            Self::Resumes => "goes on without a gap after kill -9",
            Self::WaitsForMotion => "waits for the motion of item seq - lag, and not longer",
            Self::KeepsWindow => "sends as many items as the window admits",
            Self::BeginsWithNewest => "begins with the newest pose",
            Self::PassesEnd => "passes on the end of the stream, and waits",
            Self::StopsOnRequest => "exits with code 0 on SIGTERM",
            Self::StandsBy => "stands by until the program before it has ended",
            Self::SendsValid => "sends fields that keep their rules",
            Self::RefusesMalformed => "refuses malformed inputs with code 3 and a sentence",
            Self::SameAsOwn => "gives the outputs of Gyre's own stage, to the bit",
            Self::KeepsBudget => "works within the budget",
        }
    }

    /// Returns the section of `docs/replace-a-stage.md` that demands it; empty for what the caller demands.
    pub fn section(self) -> &'static str {
        match self {
            Self::CreatesNothing | Self::StartsInTime => "contract 1",
            Self::AsksForHistory => "contract 2",
            Self::GivesHistory | Self::IgnoresObservers => "contract 3",
            Self::OneForOne | Self::CopiesItem | Self::StampsWork => "contract 4",
            Self::LooksBack => "contract 5",
            Self::Deterministic | Self::Resumes => "contract 6",
            Self::PassesEnd | Self::StopsOnRequest => "contract 7",
            Self::StandsBy => "standing by",
            Self::WaitsForMotion => "masking",
            Self::KeepsWindow => "source",
            Self::BeginsWithNewest => "sink",
            Self::SendsValid | Self::RefusesMalformed => "what is checked",
            Self::SameAsOwn => "--same-as-own",
            Self::KeepsBudget => "--budget-ms",
        }
    }
}

/// What was found about a rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "verdict", content = "why")]
pub enum Verdict {
    /// Nothing against it.
    Kept,
    /// Broken: sentences that say how.
    Broken(Vec<String>),
    /// It does not apply to this stage, or was not asked for.
    DoesNotApply(&'static str),
    /// The process did not get so far.
    NotReached,
}

/// Sentences of one rule that are kept; more of the same say nothing new.
const MAX_SENTENCES: usize = 4;

/// What was found so far.
#[derive(Debug, Default)]
pub(crate) struct Findings(BTreeMap<Rule, Verdict>);

impl Findings {
    /// Notes that a rule was checked, and nothing was found unless there is a breach.
    pub(crate) fn checked(&mut self, rule: Rule) {
        self.0.entry(rule).or_insert(Verdict::Kept);
    }

    /// Notes that a rule does not apply.
    pub(crate) fn not_for(&mut self, rule: Rule, reason: &'static str) {
        self.0.entry(rule).or_insert(Verdict::DoesNotApply(reason));
    }

    /// Notes a breach.
    pub(crate) fn broken(&mut self, rule: Rule, sentence: impl fmt::Display) {
        let sentence = sentence.to_string();
        match self.0.entry(rule).or_insert(Verdict::Kept) {
            Verdict::Broken(sentences) if sentences.contains(&sentence) => {}
            Verdict::Broken(sentences) if sentences.len() == MAX_SENTENCES => {}
            Verdict::Broken(sentences) => sentences.push(sentence),
            verdict => *verdict = Verdict::Broken(vec![sentence]),
        }
    }

    /// Notes a breach unless `holds`.
    pub(crate) fn require(&mut self, rule: Rule, holds: bool, sentence: impl FnOnce() -> String) {
        self.checked(rule);
        if !holds {
            self.broken(rule, sentence());
        }
    }

    /// Returns the verdicts on all rules, in their order.
    pub(crate) fn verdicts(mut self) -> Vec<(Rule, Verdict)> {
        let of = |rule| (rule, self.0.remove(&rule).unwrap_or(Verdict::NotReached));
        Rule::ALL.map(of).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_breach_outweighs_what_was_kept_and_is_not_said_twice() {
        let mut findings = Findings::default();
        findings.checked(Rule::OneForOne);
        (0..9).for_each(|item| findings.broken(Rule::OneForOne, format!("item {}", item % 2)));
        findings.checked(Rule::OneForOne);
        findings.not_for(Rule::KeepsWindow, "it is no source");
        let verdicts: BTreeMap<_, _> = findings.verdicts().into_iter().collect();
        let twice = Verdict::Broken(vec!["item 0".to_owned(), "item 1".to_owned()]);
        assert_eq!(verdicts[&Rule::OneForOne], twice);
        assert_eq!(
            verdicts[&Rule::KeepsWindow],
            Verdict::DoesNotApply("it is no source")
        );
        assert_eq!(verdicts[&Rule::PassesEnd], Verdict::NotReached);
        assert_eq!(verdicts.len(), Rule::ALL.len());
    }
}
