//! The report on a comparison, as a table and as JSON.

use std::fmt;

use gyre_run::latency::Percentiles;
use serde::Serialize;

use super::record::{Counts, Record, Times};
use crate::conformance::Spreads;

/// The comparison of a program with a stage of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub stage: &'static str,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// The fates of the items.
    pub counts: Counts,
    /// The differences of the results that are not identical.
    pub differences: Spreads,
    /// From the start of the work on an item to its end.
    pub work: Option<Beside>,
    /// From the publication of an item's input to the publication of its output.
    pub answer: Option<Beside>,
    /// The first breaches of the contract.
    pub breaches: Vec<String>,
    /// The first ends of the program, and their reasons.
    pub ends: Vec<String>,
    pub verdict: Verdict,
}

/// The verdict on the results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// All compared items have the same bytes.
    Identical,
    /// Some do not.
    Differs,
    /// No item was compared.
    Nothing,
}

/// Times of the same items.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Beside {
    pub shadow: Percentiles,
    /// Of the stage of the run.
    pub real: Percentiles,
}

impl Report {
    pub(crate) fn of(stage: &'static str, command: &[String], record: &Record) -> Self {
        let counts = record.counts;
        Self {
            stage,
            command: command.to_vec(),
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
        let Counts {
            deaths,
            hangs,
            breaches,
            ..
        } = self.counts;
        self.verdict != Verdict::Nothing && deaths + hangs + breaches == 0
    }

    fn words(&self) -> String {
        let Counts {
            compared,
            identical,
            ..
        } = self.counts;
        let stage = self.stage;
        match self.verdict {
            Verdict::Identical => format!("{stage}: identical in {compared} items"),
            Verdict::Differs => {
                let differing = compared - identical;
                format!("{stage}: differs in {differing} of {compared} items")
            }
            Verdict::Nothing => format!("{stage}: no item was compared"),
        }
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
        self.fmt_items(f)?;
        self.fmt_differences(f)?;
        for (name, times) in [("work", self.work), ("input to output", self.answer)] {
            let Some(times) = times else { continue };
            row_of_times(f, name, "shadow", &times.shadow)?;
            row_of_times(f, "", "real", &times.real)?;
        }
        self.fmt_faults(f)?;
        write!(f, "{}", self.words())
    }
}

impl Report {
    fn fmt_items(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts {
            observed,
            compared,
            opening,
            skipped,
            while_starting,
            unanswered,
            left,
            missed,
            gaps,
            ..
        } = self.counts;
        write!(f, "items           {observed} seen, {compared} compared")?;
        for (count, what) in [
            (opening, "only to begin with"),
            (skipped, "skipped since the shadow was behind"),
            (while_starting, "passed while it started"),
            (unanswered, "not answered"),
            (left, "left at the end"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        match missed {
            0 => writeln!(f),
            _ => writeln!(f, "; {missed} missed in {gaps} gaps"),
        }
    }

    fn fmt_differences(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts {
            compared,
            identical,
            ..
        } = self.counts;
        let differing = compared - identical;
        writeln!(
            f,
            "results         {identical} identical, {differing} differ"
        )?;
        for row in self.differences.rows() {
            writeln!(f, "  {row}")?;
        }
        match differing > 0 && self.differences.are_zero() {
            true => writeln!(
                f,
                "  they differ in other fields only, as scores and covariances"
            ),
            false => Ok(()),
        }
    }

    fn fmt_faults(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts {
            starts,
            deaths,
            hangs,
            breaches,
            ..
        } = self.counts;
        if starts > 1 || deaths + hangs > 0 {
            writeln!(
                f,
                "shadow          started {starts} times, died {deaths} times, hung {hangs} times"
            )?;
        }
        for sentence in &self.ends {
            writeln!(f, "  {sentence}")?;
        }
        if breaches > 0 {
            writeln!(f, "contract        broken {breaches} times")?;
        }
        for sentence in &self.breaches {
            writeln!(f, "  {sentence}")?;
        }
        Ok(())
    }
}

fn row_of_times(
    f: &mut fmt::Formatter<'_>,
    name: &str,
    whose: &str,
    times: &Percentiles,
) -> fmt::Result {
    let ms = [times.p50_us, times.p99_us, times.max_us].map(|us| us * 1e-3);
    let [p50, p99, max] = ms;
    writeln!(
        f,
        "{name:<15} {whose:<6} p50 {p50:.2} ms, p99 {p99:.2} ms, max {max:.2} ms"
    )
}
