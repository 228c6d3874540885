//! The rules that are checked, the verdicts on them, and the report, as a table and as JSON.

use std::{collections::BTreeMap, fmt};

use gyre_contract::run::latency::Durations;
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

#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub stage: &'static str,
    pub command: Vec<String>,
    /// The scans that its inputs were computed from.
    pub scans: usize,
    /// The verdicts, in the order of the contract.
    pub rules: Vec<Judged>,
    /// The time of its work on an item by its own stamps, with the window full.
    pub work: Option<Work>,
    /// The time from sending it an item to reading its answer, one item at a time; `None` unless
    /// there is a budget.
    pub answers: Option<Work>,
}

/// Items that are not measured: buffers grow, and memory is touched for the first time.
const WARM_UP: usize = 4;
/// The minimum number of items for a 99th percentile.
const PERCENTILE_ITEMS: u64 = 100;

/// Times of work on an item, without the first four items.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Work {
    pub items: u64,
    pub p50_ms: f64,
    /// 99th percentile, ms; `None` of fewer than a hundred items.
    pub p99_ms: Option<f64>,
    pub max_ms: f64,
}

impl Work {
    /// The figures of these times, ns, in the order of the items; `None` without one.
    pub(crate) fn of(times_ns: impl Iterator<Item = i64>) -> Option<Self> {
        let mut times = Durations::default();
        times_ns.skip(WARM_UP).for_each(|ns| times.add(ns));
        let at = |share| times.at(share).map(|ns| ns as f64 * 1e-6);
        Some(Self {
            items: times.count(),
            p50_ms: at(0.5)?,
            p99_ms: at(0.99).filter(|_| times.count() >= PERCENTILE_ITEMS),
            max_ms: at(1.0)?,
        })
    }

    /// Returns the figure that a budget is for, ms, and its name: the 99th percentile, of few items
    /// the maximum.
    pub(crate) fn judged(&self) -> (f64, &'static str) {
        match self.p99_ms {
            Some(p99_ms) => (p99_ms, "99th percentile"),
            None => (self.max_ms, "maximum"),
        }
    }
}

impl Report {
    /// Returns whether no rule is broken, and none was not reached.
    pub fn conforms(&self) -> bool {
        let not_reached = |judged: &Judged| judged.verdict == Verdict::NotReached;
        self.broken() == 0 && !self.rules.iter().any(not_reached)
    }

    pub fn broken(&self) -> usize {
        let is_broken = |judged: &&Judged| matches!(judged.verdict, Verdict::Broken(_));
        self.rules.iter().filter(is_broken).count()
    }
}

impl fmt::Display for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (p50_ms, max_ms, items) = (self.p50_ms, self.max_ms, self.items);
        let p99 = self.p99_ms.map(|ms| format!("p99 {ms:.2} ms, "));
        let p99 = p99.unwrap_or_default();
        write!(
            f,
            "p50 {p50_ms:.2} ms, {p99}max {max_ms:.2} ms of {items} items"
        )
    }
}

impl fmt::Display for Judged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (word, sentences) = match &self.verdict {
            Verdict::Kept => ("kept", &[][..]),
            Verdict::Broken(sentences) => ("BROKEN", sentences.as_slice()),
            Verdict::DoesNotApply(_) => ("-", &[][..]),
            Verdict::NotReached => ("not reached", &[][..]),
        };
        write!(f, "{word:<12} {:<16} {}", self.section, self.says)?;
        if let Verdict::DoesNotApply(reason) = self.verdict {
            write!(f, ": {reason}")?;
        }
        let mut sentences = sentences.iter();
        sentences.try_for_each(|sentence| write!(f, "\n{:<30}{sentence}", ""))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.rules.iter().try_for_each(|it| writeln!(f, "{it}"))?;
        writeln!(f)?;
        for (name, work) in [
            ("work on an item ", self.work),
            ("until the answer", self.answers),
        ] {
            work.map_or(Ok(()), |work| writeln!(f, "{name} {work}"))?;
        }
        let stage = self.stage;
        match (self.conforms(), self.broken()) {
            (true, _) => write!(f, "{stage}: conforms"),
            (false, 0) => write!(f, "{stage}: not all could be tested"),
            (false, broken) => write!(f, "{stage}: breaks the contract in {broken} of its rules"),
        }
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

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 2e-3 * b
    }

    #[test]
    fn a_hundred_items_have_a_percentile_and_the_first_items_do_not_count() {
        let of = |times_ms: &[i64]| Work::of(times_ms.iter().map(|ms| ms * 1_000_000));
        let few = of(&[&[900, 80, 70, 60][..], &[2; 19], &[5]].concat());
        assert!(few.is_some_and(|it| it.items == 20 && it.p99_ms.is_none()));
        let judged = few.map(|it| it.judged());
        assert!(judged.is_some_and(|(ms, name)| near(ms, 5.0) && name == "maximum"));
        assert_eq!(of(&[900, 80, 70, 60]), None);
        let many = of(&[&[0; 4][..], &[2; 198], &[5, 9]].concat());
        assert!(many.is_some_and(|it| it.p99_ms.is_some_and(|ms| near(ms, 2.0))));
        assert!(many.is_some_and(|it| near(it.max_ms, 9.0)));
    }

    #[test]
    fn a_rule_that_was_not_reached_is_not_broken() {
        let report = |findings: Findings| Report {
            stage: "masking",
            command: Vec::new(),
            scans: 8,
            rules: findings.judged(),
            work: None,
            answers: None,
        };
        let not_reached = report(Findings::default());
        assert!(!not_reached.conforms() && not_reached.broken() == 0);
        let mut findings = Findings::default();
        findings.broken(Rule::Resumes, "it has a gap");
        assert_eq!(report(findings).broken(), 1);
    }
}
