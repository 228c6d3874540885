//! Computes the drives of a batch, several at once.

use std::{collections::BTreeMap, time::Duration};

use gyre_stage::wake::Signals;

use crate::{
    Batch, BatchError, Drive, Outcome, Row,
    child::{Child, End},
};

/// The longest time after which the processes are looked at; the end of one is noticed at once.
const LOOK: Duration = Duration::from_secs(1);

/// How the drives have ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ended {
    /// The number of drives by outcome.
    pub counts: BTreeMap<Outcome, usize>,
    /// Those of them that had been computed before.
    pub earlier: usize,
    /// Whether the batch was interrupted before its end.
    pub interrupted: bool,
}

/// Computes all drives, and writes the row of each when it has ended. `say` gets a line for each. A request to stop ends the runs too, which
/// keep what they have.
///
/// # Errors
/// A process that cannot be started, or a row that cannot be written. The runs are ended then.
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
        let free = batch.jobs.max(1).saturating_sub(running.len());
        for drive in waiting.by_ref().take(free) {
            running.push(Child::start(batch, drive)?);
        }
        if running.is_empty() {
            return Ok(progress.ended);
        }
        if signals.sleep(LOOK)? {
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
        let kept = match end.outcome.leaves_results() {
            true => Row::of_results(out, drive, settings)?,
            false => None,
        };
        let (line, outcome, earlier) = match kept {
            // What was computed is there, though it could not be looked at again.
            Some(row) => {
                let line = format!(
                    "{}; not looked at again: {}",
                    line(&row, true),
                    end.sentence
                );
                (line, row.outcome, true)
            }
            None => {
                let row = Row::of(drive, settings, end.outcome, end.sentence, &results);
                row.write(out)?;
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

/// A drive in a line.
fn line(row: &Row, earlier: bool) -> String {
    let Row {
        drive,
        outcome,
        sentence,
        figures,
        ..
    } = row;
    let name = &drive.name;
    let earlier = if earlier { " before" } else { "" };
    match (outcome, figures.poses) {
        (Outcome::Complete, Some(poses)) => {
            let ate = figures.ate_rmse_m;
            let ate = ate.map_or(String::new(), |ate_m| format!(", ATE {ate_m:.3} m"));
            format!("{name}: complete{earlier}, {poses} poses{ate}")
        }
        _ => format!("{name}: {outcome}{earlier}: {sentence}"),
    }
}
