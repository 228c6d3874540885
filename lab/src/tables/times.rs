//! Table IIIa: how long mask, search and refinement take for a pair of scans, as far as a row has them, on one thread of this
//! process.
//!
//! - [`timer`]: a row at one size, again and again;

mod timer;

use gyre::Failure;
use gyre_radar::OwnedScan;
use serde::Serialize;

use super::{
    baseline::{Baseline, BaselineTimes},
    rows::{Row, Rows, Table},
};
use crate::{
    cli::TablesArguments,
    models::Model,
    report::{Notes, number, paragraph, table},
    sequence::Sequence,
};
use timer::Timer;

/// Scans of the sequence whose searches are timed, in turn.
const SCANS: usize = 8;

/// The table and how it was measured.
#[derive(Debug, Serialize)]
pub struct Times {
    /// The sequence's folder.
    pub data: String,
    /// The scans that were searched.
    pub scans: usize,
    /// Timed passes of each search, before the baseline and after it together.
    pub passes: usize,
    /// The baseline's version of PyTorch.
    pub baseline_torch: Option<String>,
    /// Lines, size by size.
    pub lines: Vec<TimeLine>,
    /// Rows that are left out, by the reason.
    pub left_out: Notes,
}

/// A row at one size.
#[derive(Debug, Serialize)]
pub struct TimeLine {
    /// Cells a side.
    pub n: usize,
    /// The row.
    pub row: String,
    /// The network that masks.
    pub model: Option<Model>,
    /// The time that this program takes; `None` where it has no such row, or not the network for it.
    pub ours: Option<Median>,
    /// The baseline's median, ms.
    pub baseline_ms: Option<f64>,
    /// The paper's rates on a laptop and on a Jetson, Hz.
    pub paper_hz: [Option<f64>; 2],
}

/// The median of a row's times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Median {
    /// Metres a cell.
    pub cell_m: f32,
    /// Angles that were tried, where all are.
    pub angles: Option<usize>,
    /// The median of all passes, ms.
    pub ms: f64,
    /// The medians of the passes before and after the baseline's, ms: alike on a quiet machine.
    pub halves_ms: [f64; 2],
}

impl Times {
    /// Times all rows at all sizes on scans of `sequence`: half the passes, then the baseline, then the other half.
    ///
    /// # Errors
    /// A row that cannot be timed at a size, or what the baseline says.
    pub fn measure(
        rows: &Rows,
        sequence: &Sequence,
        arguments: &TablesArguments,
        baseline: Option<Baseline<'_>>,
    ) -> Result<Self, Failure> {
        let (scans, passes) = (sequence.scans(SCANS)?, arguments.passes.get());
        let angles = sequence
            .configuration(&[])?
            .odometry
            .exhaustive
            .candidates();
        let mut times = Self {
            data: sequence.data.display().to_string(),
            scans: scans.len(),
            passes: 2 * passes,
            baseline_torch: None,
            lines: Vec::new(),
            left_out: Notes::new(),
        };
        let mut timed = Vec::new();
        for &n in &arguments.sizes {
            timed.push((n, times.timers(rows, sequence, n, arguments, &scans)?));
        }
        for (n, mut timers) in timed {
            half(&mut timers, passes)?;
            let report = arguments.out.join(format!("baseline-{n}.json"));
            let theirs = baseline
                .map(|baseline| baseline.time(n, times.passes, angles, &report))
                .transpose()?;
            half(&mut timers, passes)?;
            let line = |(row, timer)| TimeLine::new(rows, n, row, timer, theirs.as_ref());
            times.lines.extend(timers.into_iter().map(line));
            times.baseline_torch = theirs.map(|theirs| theirs.torch);
        }
        Ok(times)
    }

    /// The rows at one size. Where the network of one is missing there is only what the paper and the baseline say, if they do.
    fn timers<'a>(
        &mut self,
        rows: &'a Rows,
        sequence: &Sequence,
        n: usize,
        arguments: &TablesArguments,
        scans: &[OwnedScan],
    ) -> Result<Vec<(&'a Row, Option<Timer>)>, Failure> {
        let mut timers = Vec::new();
        for row in rows.of(Table::Times) {
            let model = match row.mask.is_empty() {
                true => Ok(None),
                false => Model::find(&arguments.sequences.models, &row.mask, n, None).map(Some),
            };
            match model {
                Ok(model) => {
                    let changes = row.changes(rows, model.as_ref());
                    let timer = Timer::new(sequence, row, &changes, model, n, scans)?;
                    timers.push((row, Some(timer)));
                }
                Err(reason) => {
                    let name = format!("{} at {n}", row.name);
                    self.left_out.entry(reason).or_default().push(name);
                    timers.extend(row.is_of_paper().then_some((row, None)));
                }
            }
        }
        Ok(timers)
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let header = [
            "n",
            "cell m",
            "row",
            "ms",
            "Hz",
            "ms an angle",
            "baseline ms",
            "baseline / ours",
            "paper Hz, laptop",
            "paper Hz, Jetson",
            "mask",
        ];
        let baseline = self.baseline_torch.as_ref().map_or_else(String::new, |torch| {
            format!(
                " Baseline: PyTorch {torch}, one thread, on noise, its median, between the two halves; it transforms both scans of \
                 each pair and tries as many angles."
            )
        });
        let legend = format!(
            "\nms: for a scan, one thread, median of {} passes over {} scans of {}, the earlier scan's spectrum kept as in a run \
             (not where a mask looks at both), rasters and points ready. The rows that mask include the mask; mask: that alone. \
             The rows that refine do so at every size with the same points. The two halves of the passes differ by at most \
             {:.0} %.{baseline} Paper: a Core i7 at 2.9 GHz; a Jetson Nano with its GPU. -: not given there, or not there here.\n",
            self.passes,
            self.scans,
            self.data,
            100.0 * self.difference_of_halves(),
        );
        let lines = table(&header, self.lines.iter().map(TimeLine::cells));
        let left_out = paragraph("Left out", &self.left_out);
        format!("\n## IIIa: time of a search\n\n{lines}{legend}{left_out}")
    }

    /// The largest of all rows: small on a quiet machine.
    fn difference_of_halves(&self) -> f64 {
        let halves = self
            .lines
            .iter()
            .filter_map(|line| Some(line.ours?.halves_ms));
        let differences = halves.map(|[first, second]| (second / first - 1.0).abs());
        differences
            .filter(|difference| difference.is_finite())
            .fold(0.0, f64::max)
    }
}

fn half(timers: &mut [(&Row, Option<Timer>)], passes: usize) -> Result<(), Failure> {
    timers
        .iter_mut()
        .filter_map(|(_, timer)| timer.as_mut())
        .try_for_each(|timer| timer.half(passes))
}

impl TimeLine {
    fn new(
        rows: &Rows,
        n: usize,
        row: &Row,
        timer: Option<Timer>,
        baseline: Option<&BaselineTimes>,
    ) -> Self {
        let theirs = row.baseline.as_ref().zip(baseline);
        Self {
            n,
            row: row.name.clone(),
            model: timer.as_ref().and_then(|timer| timer.model.clone()),
            ours: timer.map(Timer::median),
            baseline_ms: theirs.and_then(|(row, baseline)| baseline.median_ms(n, row)),
            paper_hz: rows.figures(row, Table::Times, n),
        }
    }

    fn cells(&self) -> Vec<String> {
        let (ours, theirs) = (self.ours, self.baseline_ms);
        let ms = ours.map(|ours| ours.ms);
        let [laptop, jetson] = self.paper_hz.map(|hz| number(hz, 1));
        let mask = self
            .model
            .as_ref()
            .map_or_else(|| "-".to_owned(), |model| model.card.display().to_string());
        vec![
            self.n.to_string(),
            number(ours.map(|ours| ours.cell_m.into()), 2),
            self.row.clone(),
            number(ms, 3),
            number(ms.map(|ms| 1e3 / ms), 1),
            number(ours.and_then(|ours| Some(ours.ms / ours.angles? as f64)), 3),
            number(theirs, 2),
            number(ms.and_then(|ms| Some(theirs? / ms)), 1),
            laptop,
            jetson,
            mask,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_ours_the_baselines_and_the_papers_figures() {
        let ours = Median {
            cell_m: 0.4,
            angles: Some(31),
            ms: 6.2,
            halves_ms: [6.0, 6.6],
        };
        let line = TimeLine {
            n: 255,
            row: "f-raw".to_owned(),
            model: None,
            ours: Some(ours),
            baseline_ms: Some(20.0),
            paper_hz: [Some(58.2), None],
        };
        let expected = [
            "255", "0.40", "f-raw", "6.200", "161.3", "0.200", "20.00", "3.2", "58.2", "-", "-",
        ];
        assert_eq!(line.cells(), expected);
        let without = TimeLine { ours: None, ..line };
        assert_eq!(without.cells()[3..8], ["-", "-", "-", "20.00", "-"]);
    }
}
