//! The table of all faults.

use std::{collections::BTreeMap, fmt};

use super::scene::{End, Outcome};

/// The outcomes of the faults, by kind.
#[derive(Default)]
pub struct Table {
    kinds: BTreeMap<&'static str, Vec<Result<Outcome, u64>>>,
    skipped: BTreeMap<&'static str, &'static str>,
}

/// Returns the outcome of a fault in a word; an error is its seed.
pub fn word(outcome: &Result<Outcome, u64>) -> String {
    match outcome {
        Ok(Outcome { end, .. }) => format!("{end:?}").to_lowercase(),
        Err(seed) => format!("NOT SURVIVED (GYRE_FAULTS_SEED={seed} GYRE_FAULTS_EVENTS=1)"),
    }
}

impl Table {
    /// Adds a fault.
    pub fn add(&mut self, kind: &'static str, outcome: Result<Outcome, u64>) {
        self.kinds.entry(kind).or_default().push(outcome);
    }

    /// Adds a kind that is not possible here.
    pub fn skip(&mut self, kind: &'static str, reason: &'static str) {
        self.skipped.insert(kind, reason);
    }

    /// Kinds and seeds of the faults that were not survived.
    pub fn findings(&self) -> Vec<(&str, u64)> {
        let of = |(kind, outcomes): (&&'static str, &Vec<Result<Outcome, u64>>)| {
            let seeds = outcomes.iter().filter_map(|outcome| outcome.as_ref().err());
            seeds.map(|seed| (*kind, *seed)).collect::<Vec<_>>()
        };
        self.kinds.iter().flat_map(of).collect()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:46} {:>6} {:>8} {:>7} {:>7} {:>4}  recovery p50, max (ms)",
            "kind", "events", "finished", "resumed", "refused", "lost"
        )?;
        for (kind, outcomes) in &self.kinds {
            row(f, kind, outcomes.iter())?;
        }
        row(f, "all", self.kinds.values().flatten())?;
        for (kind, reason) in &self.skipped {
            writeln!(f, "{:46} skipped: {reason}", kind.replace('_', " "))?;
        }
        Ok(())
    }
}

fn row<'a>(
    f: &mut fmt::Formatter<'_>,
    kind: &str,
    outcomes: impl Iterator<Item = &'a Result<Outcome, u64>> + Clone,
) -> fmt::Result {
    let survived = || outcomes.clone().flatten();
    let with = |end| survived().filter(move |outcome| outcome.end == end).count();
    let mut recovery: Vec<f64> = survived()
        .flat_map(|outcome| outcome.recovery_ms.iter().copied())
        .collect();
    recovery.sort_by(f64::total_cmp);
    let recovery = match recovery.last() {
        Some(max) => format!(
            "{:.1}, {max:.1} (n = {})",
            recovery[recovery.len() / 2],
            recovery.len()
        ),
        None => String::new(),
    };
    let events = outcomes.clone().count();
    writeln!(
        f,
        "{:46} {events:>6} {:>8} {:>7} {:>7} {:>4}  {recovery}",
        kind.replace('_', " "),
        with(End::Finished),
        with(End::Resumed),
        with(End::Refused),
        events - survived().count(),
    )
}
