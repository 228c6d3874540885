//! The report on a comparison, as a table and as JSON.

use std::fmt;

use gyre_contract::run::latency::Percentiles;
use serde::Serialize;

use super::record::{Counts, Record, Times};
use crate::conformance::{Candidate, Spreads};

#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub stage: &'static str,
    pub command: Vec<String>,
    pub counts: Counts,
    pub differences: Spreads,
    /// From the start of the work on an item to its end.
    pub work: Option<Beside>,
    /// From the publication of an item's input to the publication of its output.
    pub answer: Option<Beside>,
    pub breaches: Vec<String>,
    pub ends: Vec<String>,
    pub verdict: Verdict,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// All compared items have the same bytes.
    Identical,
    Differs,
    Nothing,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Beside {
    pub shadow: Percentiles,
    pub real: Percentiles,
}

impl Report {
    pub(crate) fn of(candidate: &Candidate, record: &Record) -> Self {
        let counts = record.counts;
        Self {
            stage: candidate.stage.name(),
            command: candidate.command.clone(),
            counts,
            differences: record.differences.spreads(),
            work: Beside::of(&record.work),
            answer: Beside::of(&record.answer),
            breaches: record.breaches.clone(),
            ends: record.ends.clone(),
            verdict: match counts.compared {
                0 => Verdict::Nothing,
                compared if compared == counts.identical => Verdict::Identical,
                _ => Verdict::Differs,
            },
        }
    }

    /// Returns whether items were compared, and the program has neither died nor hung nor broken
    /// the contract. Its results may differ.
    pub fn is_sound(&self) -> bool {
        let faults = self.counts.deaths + self.counts.hangs + self.counts.breaches;
        self.verdict != Verdict::Nothing && faults == 0
    }
}

impl Beside {
    fn of(times: &Times) -> Option<Self> {
        Some(Self {
            shadow: times.shadow.percentiles_if_any()?,
            real: times.real.percentiles_if_any()?,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (counts, stage) = (&self.counts, self.stage);
        let (compared, identical) = (counts.compared, counts.identical);
        let differing = compared - identical;
        row_of_items(f, counts)?;
        writeln!(
            f,
            "results         {identical} identical, {differing} differ"
        )?;
        let rows = self.differences.rows();
        rows.iter().try_for_each(|row| writeln!(f, "  {row}"))?;
        if differing > 0 && self.differences.are_zero() {
            writeln!(
                f,
                "  they differ in other fields only, as scores and covariances"
            )?;
        }
        for (name, times) in [("work", self.work), ("input to output", self.answer)] {
            let Some(times) = times else { continue };
            row_of_times(f, name, "shadow", &times.shadow)?;
            row_of_times(f, "", "real", &times.real)?;
        }
        let (starts, deaths, hangs) = (counts.starts, counts.deaths, counts.hangs);
        if starts > 1 || deaths + hangs > 0 {
            writeln!(
                f,
                "shadow          started {starts} times, died {deaths} times, hung {hangs} times"
            )?;
        }
        self.ends.iter().try_for_each(|it| writeln!(f, "  {it}"))?;
        if counts.breaches > 0 {
            writeln!(f, "contract        broken {} times", counts.breaches)?;
        }
        self.breaches
            .iter()
            .try_for_each(|it| writeln!(f, "  {it}"))?;
        match self.verdict {
            Verdict::Identical => write!(f, "{stage}: identical in {compared} items"),
            Verdict::Differs => write!(f, "{stage}: differs in {differing} of {compared} items"),
            Verdict::Nothing => write!(f, "{stage}: no item was compared"),
        }
    }
}

fn row_of_items(f: &mut fmt::Formatter<'_>, counts: &Counts) -> fmt::Result {
    let (observed, compared) = (counts.observed, counts.compared);
    write!(f, "items           {observed} seen, {compared} compared")?;
    for (count, what) in [
        (counts.opening, "only to begin with"),
        (counts.skipped, "skipped since the shadow was behind"),
        (counts.while_starting, "passed while it started"),
        (counts.unanswered, "not answered"),
        (counts.left, "left at the end"),
    ] {
        if count > 0 {
            write!(f, ", {count} {what}")?;
        }
    }
    match counts.missed {
        0 => writeln!(f),
        missed => writeln!(f, "; {missed} missed in {} gaps", counts.gaps),
    }
}

fn row_of_times(
    f: &mut fmt::Formatter<'_>,
    name: &str,
    whose: &str,
    times: &Percentiles,
) -> fmt::Result {
    let [p50, p99, max] = [times.p50_us, times.p99_us, times.max_us].map(|us| us * 1e-3);
    writeln!(
        f,
        "{name:<15} {whose:<6} p50 {p50:.2} ms, p99 {p99:.2} ms, max {max:.2} ms"
    )
}
