//! The rules that are checked, and the verdicts on them.

use std::{collections::BTreeMap, fmt};

use serde::Serialize;

/// Defines the rules: name, section of `docs/replace-a-stage.md` or option that demands it, and the
/// conduct of a program that keeps it.
macro_rules! rules {
    ($($rule:ident: $section:literal, $says:literal;)+) => {
        /// A rule of the contract: a program that keeps it ...
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum Rule {
            $(
                #[doc = concat!("... ", $says, ".")]
                $rule,
            )+
        }

        impl Rule {
            /// All rules, each with the section of `docs/replace-a-stage.md` or the option that
            /// demands it, and the conduct of a program that keeps it.
            const ALL: [(Self, &'static str, &'static str); [$($says,)+].len()] =
                [$((Self::$rule, $section, $says),)+];
        }
    };
}

rules! {
    CreatesNothing: "contract 1", "opens its topics and creates none";
    StartsInTime: "contract 1", "has opened its topics in time";
    AsksForHistory: "contract 2", "joins by the subscribe handshake";
    GivesHistory: "contract 3", "gives a late reader its history";
    IgnoresObservers: "contract 3", "is not disturbed by observers";
    OneForOne: "contract 4", "sends one item for each, with consecutive numbers";
    CopiesItem: "contract 4", "copies the item of its input";
    StampsWork: "contract 4", "fills in its own time stamps";
    LooksBack: "contract 5", "needs no earlier item but the previous one";
    Deterministic: "contract 6", "gives the same outputs for the same inputs";
    Resumes: "contract 6", "continues without a gap after kill -9";
    WaitsForMotion: "masking", "waits for the motion of item seq - lag, and not longer";
    KeepsWindow: "source", "sends as many items as the window admits";
    BeginsWithNewest: "sink", "begins with the newest pose";
    PassesEnd: "contract 7", "passes on the end of the stream, and waits";
    StopsOnRequest: "contract 7", "exits with code 0 on SIGTERM";
    StandsBy: "standing by", "stands by until the program before it has ended";
    SendsValid: "what is checked", "sends fields that keep their rules";
    RefusesMalformed: "what is checked", "refuses malformed inputs with code 3 and a sentence";
    SameAsOwn: "--same-as-own", "gives the outputs of Gyre's own stage, to the bit";
    KeepsBudget: "--budget-ms", "works within the budget";
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "verdict", content = "why")]
pub enum Verdict {
    Kept,
    /// Broken: sentences about the breaches.
    Broken(Vec<String>),
    /// It does not apply to this stage, or was not asked for.
    DoesNotApply(&'static str),
    /// The process did not get so far.
    NotReached,
}

#[derive(Clone, Debug, Serialize)]
pub struct Judged {
    pub rule: Rule,
    pub section: &'static str,
    /// The conduct of a program that keeps it.
    pub says: &'static str,
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// The number of sentences that are kept for each rule; more would repeat the same fault.
const MAX_SENTENCES: usize = 4;

#[derive(Debug, Default)]
pub(crate) struct Findings {
    verdicts: BTreeMap<Rule, Verdict>,
    /// The result bytes of the first scenario, by item.
    pub first_results: BTreeMap<u64, Vec<u8>>,
}

impl Findings {
    /// Notes that a rule was checked, and nothing was found unless there is a breach.
    pub(crate) fn checked(&mut self, rule: Rule) {
        self.verdicts.entry(rule).or_insert(Verdict::Kept);
    }

    pub(crate) fn not_for(&mut self, rule: Rule, reason: &'static str) {
        self.verdicts
            .entry(rule)
            .or_insert(Verdict::DoesNotApply(reason));
    }

    pub(crate) fn broken(&mut self, rule: Rule, sentence: impl fmt::Display) {
        let sentence = sentence.to_string();
        match self.verdicts.entry(rule).or_insert(Verdict::Kept) {
            Verdict::Broken(sentences) if sentences.contains(&sentence) => {}
            Verdict::Broken(sentences) if sentences.len() == MAX_SENTENCES => {}
            Verdict::Broken(sentences) => sentences.push(sentence),
            verdict => *verdict = Verdict::Broken(vec![sentence]),
        }
    }

    pub(crate) fn require(&mut self, rule: Rule, holds: bool, sentence: impl FnOnce() -> String) {
        self.checked(rule);
        if !holds {
            self.broken(rule, sentence());
        }
    }

    pub(crate) fn judged(mut self) -> Vec<Judged> {
        let of = |(rule, section, says)| Judged {
            rule,
            section,
            says,
            verdict: self.verdicts.remove(&rule).unwrap_or(Verdict::NotReached),
        };
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
        let judged = findings.judged().into_iter();
        let verdicts: BTreeMap<_, _> = judged.map(|it| (it.rule, it.verdict)).collect();
        let twice = Verdict::Broken(vec!["item 0".to_owned(), "item 1".to_owned()]);
        assert_eq!(verdicts[&Rule::OneForOne], twice);
        let no_source = Verdict::DoesNotApply("it is no source");
        assert_eq!(verdicts[&Rule::KeepsWindow], no_source);
        assert_eq!(verdicts[&Rule::PassesEnd], Verdict::NotReached);
        assert_eq!(verdicts.len(), Rule::ALL.len());
    }
}
