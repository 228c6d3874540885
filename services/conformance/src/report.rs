//! The report of a test, as a table and as JSON.

use std::fmt;

use gyre_messages::StageId;
use gyre_stage::supervise::rig::Recorded;
use serde::Serialize;

use crate::{
    content::work_ns,
    rule::{Rule, Verdict},
};

/// What was found out about a program.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The stage that it replaces.
    pub stage: &'static str,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// The scans that its inputs were computed from.
    pub scans: usize,
    /// The verdicts, in the order of the contract.
    pub rules: Vec<Judged>,
    /// The time of its work on an item, with the window full.
    pub work: Option<Work>,
    /// That of Gyre's own stage on the same inputs, directly after.
    pub own_work: Option<Work>,
    /// How far its results are from those of Gyre's own stage.
    pub deviation: Option<String>,
}

/// A rule and the verdict on it.
#[derive(Clone, Debug, Serialize)]
pub struct Judged {
    /// The rule.
    pub rule: Rule,
    /// The section of the contract.
    pub section: &'static str,
    /// What a program that keeps it does.
    pub says: &'static str,
    /// The verdict.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// Times of work on an item, from `started_ns` to `finished_ns`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Work {
    /// The items.
    pub items: usize,
    /// Median, ms.
    pub p50_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Maximum, ms.
    pub max_ms: f64,
}

impl Work {
    /// The times of a stage's messages; `None` without one.
    pub(crate) fn of<'a>(
        stage: StageId,
        messages: impl Iterator<Item = &'a Recorded>,
    ) -> Option<Self> {
        let mut times: Vec<i64> = messages.map(|message| work_ns(stage, message)).collect();
        times.sort_unstable();
        let ms = |ns: i64| ns as f64 * 1e-6;
        let at = |share: f64| ms(times[((times.len() - 1) as f64 * share).ceil() as usize]);
        let last = *times.last()?;
        Some(Self {
            items: times.len(),
            p50_ms: at(0.5),
            p99_ms: at(0.99),
            max_ms: ms(last),
        })
    }
}

impl Report {
    /// Returns whether no rule is broken, and none was not reached.
    pub fn conforms(&self) -> bool {
        let fails =
            |judged: &Judged| matches!(judged.verdict, Verdict::Broken(_) | Verdict::NotReached);
        !self.rules.iter().any(fails)
    }

    fn broken(&self) -> usize {
        let rules = self.rules.iter();
        rules
            .filter(|judged| matches!(judged.verdict, Verdict::Broken(_)))
            .count()
    }
}

impl fmt::Display for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            items,
            p50_ms,
            p99_ms,
            max_ms,
        } = self;
        write!(
            f,
            "p50 {p50_ms:.2} ms, p99 {p99_ms:.2} ms, max {max_ms:.2} ms of {items} items"
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
        sentences
            .iter()
            .try_for_each(|sentence| write!(f, "\n{:<30}{sentence}", ""))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for judged in &self.rules {
            writeln!(f, "{judged}")?;
        }
        writeln!(f)?;
        if let Some(work) = &self.work {
            writeln!(f, "work on an item  {work}")?;
        }
        if let Some(own) = &self.own_work {
            writeln!(f, "our own stage    {own}")?;
            if let Some(work) = &self.work {
                writeln!(f, "ratio            {:.2} of p50", work.p50_ms / own.p50_ms)?;
            }
        }
        if let Some(deviation) = &self.deviation {
            writeln!(f, "results          {deviation}")?;
        }
        let stage = self.stage;
        match (self.conforms(), self.broken()) {
            (true, _) => write!(f, "{stage}: conforms"),
            (false, 0) => write!(f, "{stage}: not all could be tested"),
            (false, broken) => write!(f, "{stage}: breaks the contract in {broken} of its rules"),
        }
    }
}
