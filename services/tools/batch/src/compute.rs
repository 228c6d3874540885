//! Computes the drives of a batch, several at once.

use std::{collections::BTreeMap, time::Duration};

use gyre_stage::wake::Signals;
use serde_json::Value;

use crate::{
    Batch, BatchError, Drive, DriveOutcome, DriveRow,
    child::{Child, End},
};

/// The longest time between two polls of the processes; the end of one is noticed at once.
const POLL_PERIOD: Duration = Duration::from_secs(1);

/// The outcomes of the drives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ended {
    /// The number of drives by outcome.
    pub counts: BTreeMap<DriveOutcome, usize>,
    /// Those of them that had been computed before.
    pub earlier: usize,
    /// True if the batch was interrupted before its end.
    pub interrupted: bool,
}

/// Computes all drives, and writes the row of each when it has ended. `say` gets a line for each. A
/// request to stop ends the runs too, whose results so far are kept.
///
/// # Errors
/// A process that cannot be started, or a row that cannot be written, other than for a full disk.
/// The runs are ended then.
pub fn compute(
    batch: &Batch<'_>,
    signals: &Signals,
    say: &mut dyn FnMut(&str),
) -> Result<Ended, BatchError> {
    prepare(batch)?;
    let mut progress = Progress {
        batch,
        ended: Ended::default(),
        say,
    };
    let mut waiting = batch.drives.iter();
    let mut running: Vec<Child<'_>> = Vec::new();
    loop {
        while running.len() < batch.jobs.max(1)
            && let Some(drive) = waiting.next()
        {
            match Child::start(batch, drive) {
                Ok(child) => running.push(child),
                Err(error) => progress.add(drive, End::of_full(error)?)?,
            }
        }
        if running.is_empty() {
            return Ok(progress.ended);
        }
        if signals.sleep(POLL_PERIOD)? {
            return progress.interrupt(running);
        }
        let mut going_on = Vec::new();
        for mut child in running {
            match child.ended(&batch.out) {
                Some(end) => progress.add(child.drive, end)?,
                None => going_on.push(child),
            }
        }
        running = going_on;
    }
}

/// Creates the folders of a batch.
fn prepare(batch: &Batch<'_>) -> Result<(), BatchError> {
    for name in ["drives", "output", "rows"] {
        gyre_storage::create_folder(&batch.out.join(name))?;
    }
    Ok(())
}

struct Progress<'a> {
    batch: &'a Batch<'a>,
    ended: Ended,
    say: &'a mut dyn FnMut(&str),
}

impl Progress<'_> {
    fn add(&mut self, drive: &Drive, end: End) -> Result<(), BatchError> {
        let Batch {
            settings,
            out,
            drives,
            ..
        } = self.batch;
        let results = self.batch.results(drive);
        let kept = match end.outcome.leaves_results() || !end.begun {
            true => DriveRow::of_results(out, drive, settings)?,
            false => None,
        };
        let (line, outcome, earlier) = match kept {
            // The results are there, though they could not be checked again.
            Some(row) => {
                let line = format!(
                    "{}; not looked at again: {}",
                    line(&row, true),
                    end.sentence
                );
                (line, row.outcome, true)
            }
            None => {
                let mut row = DriveRow::of(drive, settings, end.outcome, end.sentence, &results);
                if let Err(error) = row.write(out) {
                    // Its results, if there are any, have a row when there is room again.
                    let full = End::of_full(error)?;
                    (row.outcome, row.sentence) = (full.outcome, full.sentence);
                }
                (line(&row, end.earlier), row.outcome, end.earlier)
            }
        };
        *self.ended.counts.entry(outcome).or_default() += 1;
        self.ended.earlier += usize::from(earlier);
        let number: usize = self.ended.counts.values().sum();
        (self.say)(&format!("[{number}/{}] {line}", drives.len()));
        Ok(())
    }

    /// Ends the runs, all at once, since each may have results to write.
    fn interrupt(mut self, mut running: Vec<Child<'_>>) -> Result<Ended, BatchError> {
        running.iter_mut().for_each(Child::ask_to_end);
        for mut child in running {
            let end = child.interrupt(&self.batch.out)?;
            self.add(child.drive, end)?;
        }
        self.ended.interrupted = true;
        Ok(self.ended)
    }
}

/// Returns a line about a drive.
fn line(row: &DriveRow, earlier: bool) -> String {
    let DriveRow {
        drive,
        outcome,
        sentence,
        figures,
        ..
    } = row;
    let name = &drive.name;
    let earlier = if earlier { " before" } else { "" };
    match (outcome, figures.get("poses")) {
        (DriveOutcome::Complete, Some(poses)) => {
            let ate = figures.get("ate_rmse_m").and_then(Value::as_f64);
            let ate = ate.map_or(String::new(), |ate_m| format!(", ATE {ate_m:.3} m"));
            format!("{name}: complete{earlier}, {poses} poses{ate}")
        }
        _ => format!("{name}: {outcome}{earlier}: {sentence}"),
    }
}
