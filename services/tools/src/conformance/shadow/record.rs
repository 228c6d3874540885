//! The record of a comparison: counts, differences, times, and a row of `shadow.csv` for each item;
//! the report on it, as a table and as JSON.

use std::{fmt, fs::File, path::Path};

use gyre_client::RunError;
use gyre_configuration::terminal::Failure;
use gyre_contract::{
    Item, StageId,
    run::latency::{Durations, Percentiles},
};
use gyre_supervise::rig::Recorded;
use serde::Serialize;

use crate::conformance::{
    Candidate, Spreads,
    result::{Differences, result_bytes, work_ns},
};

/// Sentences about breaches and deaths that are kept; more are counted.
const SENTENCES: usize = 5;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Items of the stage that were seen whole.
    pub observed: u64,
    pub compared: u64,
    /// Compared items with the same bytes.
    pub identical: u64,
    /// Items that only opened the stream for the shadow: at its start, after a gap and after
    /// skipped items.
    pub opening: u64,
    /// Items that were left out because the shadow was behind.
    pub skipped: u64,
    /// Items that passed while the shadow was starting.
    pub while_starting: u64,
    /// Items that the shadow had and did not answer, or not in a form that can be read.
    pub unanswered: u64,
    /// Items that were not sent to it any more when the comparison ended.
    pub left: u64,
    /// Items that were not seen whole.
    pub missed: u64,
    pub gaps: u64,
    pub starts: u64,
    /// Ends of the shadow that were not asked for.
    pub deaths: u64,
    /// The number of kills because the program did not start or answer in time.
    pub hangs: u64,
    pub breaches: u64,
}

/// Times of the shadow and of the stage of the run, for the same items.
#[derive(Debug, Default)]
struct Times {
    shadow: Durations,
    real: Durations,
}

pub(crate) struct Record {
    stage: StageId,
    topic: &'static str,
    rows: Option<csv::Writer<File>>,
    pub counts: Counts,
    differences: Differences,
    work: Times,
    answer: Times,
    breaches: Vec<String>,
    pub ends: Vec<String>,
}

#[derive(Debug, Serialize)]
struct ComparedItem {
    seq: u64,
    scan: u64,
    stamp_ns: i64,
    identical: u8,
    mask_difference: Option<f64>,
    translation_m: Option<f64>,
    rotation_deg: Option<f64>,
    shadow_work_ms: Option<f64>,
    real_work_ms: Option<f64>,
    shadow_answer_ms: Option<f64>,
    real_answer_ms: Option<f64>,
}

impl Record {
    /// Begins a record; with `rows` each item becomes a row of this file.
    pub(crate) fn new(
        stage: StageId,
        topic: &'static str,
        rows: Option<&Path>,
    ) -> Result<Self, RunError> {
        let rows = rows.map(|path| File::create(path).map_err(RunError::file(path)));
        Ok(Self {
            stage,
            topic,
            rows: rows.transpose()?.map(csv::Writer::from_writer),
            counts: Counts::default(),
            differences: Differences::default(),
            work: Times::default(),
            answer: Times::default(),
            breaches: Vec::new(),
            ends: Vec::new(),
        })
    }

    /// Compares the results of the run and of the shadow for an item. `answer_ns`: from the
    /// shadow's input to its output; `None` if it had more than this item to work on.
    pub(crate) fn compare(
        &mut self,
        real: &Recorded,
        shadow: &Recorded,
        answer_ns: Option<i64>,
    ) -> Result<(), Failure> {
        let identical = result_bytes(self.topic, real)? == result_bytes(self.topic, shadow)?;
        self.counts.compared += 1;
        self.counts.identical += u64::from(identical);
        let [mask_difference, translation_m, rotation_deg] = match identical {
            true => [None; 3],
            false => self.differences.add(self.topic, real, shadow)?,
        };
        let (real, shadow) = (real.item(), shadow.item());
        let work = Some((work_ns(self.stage, &shadow), work_ns(self.stage, &real)));
        let answers = answer_ns.zip(self.answer_ns(&real));
        let [shadow_work_ms, real_work_ms] = self.work.add(work);
        let [shadow_answer_ms, real_answer_ms] = self.answer.add(answers);
        let row = ComparedItem {
            seq: real.seq,
            scan: real.scan,
            stamp_ns: real.stamp_ns,
            identical: identical.into(),
            mask_difference,
            translation_m,
            rotation_deg,
            shadow_work_ms,
            real_work_ms,
            shadow_answer_ms,
            real_answer_ms,
        };
        if let Some(rows) = &mut self.rows {
            // At once: a person or a script reads them as they come.
            let written = rows.serialize(row).and_then(|()| Ok(rows.flush()?));
            written.map_err(|error| format!("cannot write shadow.csv: {error}"))?;
        }
        Ok(())
    }

    /// Returns the time from the publication of an item's last input to the publication of the
    /// item, in the run.
    fn answer_ns(&self, item: &Item) -> Option<i64> {
        let stage = self.stage as usize;
        let before = item.hops[..stage].iter().map(|hop| hop.published_ns).max();
        let before = before.filter(|published_ns| *published_ns > 0)?;
        Some(item.hops[stage].published_ns.saturating_sub(before))
    }

    pub(crate) fn breach(&mut self, sentence: String) {
        self.counts.breaches += 1;
        keep(&mut self.breaches, sentence);
    }
}

impl Times {
    /// Adds the times of the shadow and of the stage, ns, and returns them in ms.
    fn add(&mut self, times_ns: Option<(i64, i64)>) -> [Option<f64>; 2] {
        let Some((shadow_ns, real_ns)) = times_ns else {
            return [None; 2];
        };
        self.shadow.add(shadow_ns);
        self.real.add(real_ns);
        [shadow_ns, real_ns].map(|ns| Some(ns as f64 / 1e6))
    }
}

pub(crate) fn keep(sentences: &mut Vec<String>, sentence: String) {
    if sentences.len() < SENTENCES {
        sentences.push(sentence);
    }
}

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
