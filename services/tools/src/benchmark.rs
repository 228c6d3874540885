//! Benchmarks: the rules that judge the drives of a dataset, and the files that a benchmark's tools
//! read.

use std::{num::NonZeroUsize, path::Path};

use clap::{ValueEnum, builder::PossibleValue};
use gyre_configuration::terminal::{Failure, print};
use gyre_datasets::{read_trajectory, write_kitti, write_tum};
use gyre_radar::Trajectory;
use gyre_results::{
    evaluate::truth_of_run,
    evaluation::{Evaluation, STEP, evaluate, fomo, kitti, resampled},
    judgement::note_time_offset,
};
use gyre_storage::create_folder;

use crate::batch::Row;

/// The table in the folder of the batch.
const TABLE: &str = "benchmark.csv";
/// The folder of the files, in the folder of the batch.
const FILES: &str = "files";
/// The period that fomo-sdk assumes when it looks for the shift of the times.
const FOMO_PERIOD_NS: i64 = 100_000_000;

/// The figures of a drive, each with the name of its column.
type Figures = Vec<(String, Option<f64>)>;

#[derive(Clone, Copy, Debug)]
pub struct Benchmark {
    /// Also the name of the configuration.
    pub name: &'static str,
    /// The KITTI metric: a prefix of its columns, and the poses from segment to segment.
    kitti: &'static [(&'static str, NonZeroUsize)],
    files: Files,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Files {
    /// `est/00.txt` and `gt/00.txt`, which CFEAR's evaluation reads, and so on for each drive.
    Kitti,
    /// A zip that `python -m gyre.boreas` writes, for the benchmark of this name.
    Zip(&'static str),
    /// `RECORDING_RECORDING.txt`: TUM at 10 Hz.
    Fomo,
}

const STEP_4: NonZeroUsize = NonZeroUsize::MIN.saturating_add(3);

#[rustfmt::skip]
const BENCHMARKS: [Benchmark; 5] = [
    Benchmark { name: "oxford", kitti: &[("hero_step4", STEP_4), ("cfear_step10", STEP)], files: Files::Kitti },
    Benchmark { name: "mulran", kitti: &[("step10", STEP)], files: Files::Kitti },
    Benchmark { name: "boreas", kitti: &[("step4", STEP_4)], files: Files::Zip("boreas") },
    Benchmark { name: "boreas-rt", kitti: &[("step4", STEP_4)], files: Files::Zip("boreasrt") },
    Benchmark { name: "fomo", kitti: &[], files: Files::Fomo },
];

impl ValueEnum for Benchmark {
    fn value_variants<'a>() -> &'a [Self] {
        &BENCHMARKS
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name))
    }
}

impl Benchmark {
    /// Judges the drives of a batch, and writes the files and the table with the means. Returns the
    /// table as text, and where the files are; a drive without figures is reported.
    pub fn judge(&self, rows: &[Row], batch: &Path) -> Result<String, Failure> {
        let nothing = self.figures(None);
        let mut lines = Vec::with_capacity(rows.len() + 1);
        for (number, row) in rows.iter().enumerate() {
            let (name, has_results) = (row.drive.name.clone(), row.outcome.has_results());
            let note = |reason: &Failure| print::note(format_args!("{name}: {reason}"));
            let judged = has_results.then(|| self.judge_drive(number, row, batch));
            let judged = judged.and_then(|judged| judged.inspect_err(note).ok());
            lines.push((name, judged.unwrap_or_else(|| nothing.clone())));
        }
        let mean = |column: usize| {
            let values: Vec<f64> = lines.iter().filter_map(|(_, it)| it[column].1).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (String::new(), (!values.is_empty()).then_some(mean))
        };
        let means = (0..nothing.len()).map(mean).collect();
        lines.push(("mean".to_owned(), means));
        let names = nothing.into_iter().map(|(name, _)| name).collect();
        let mut table = vec![[vec!["drive".to_owned()], names].concat()];
        for (name, figures) in lines {
            let cell = |(_, value): (_, Option<f64>)| value.map(|value| format!("{value:.4}"));
            let cells = figures.into_iter().map(|it| cell(it).unwrap_or_default());
            table.push([vec![name], cells.collect()].concat());
        }
        let mut csv = csv::Writer::from_writer(Vec::new());
        table.iter().try_for_each(|row| csv.write_record(row))?;
        gyre_storage::write(&batch.join(TABLE), csv.into_inner()?)?;
        Ok(aligned(&table) + &self.next(batch))
    }

    /// Returns the figures of a drive, and writes its files.
    fn judge_drive(&self, number: usize, row: &Row, batch: &Path) -> Result<Figures, Failure> {
        let (name, run) = (&row.drive.name, Row::results(batch, &row.drive));
        let mut estimate = read_trajectory(&run.join("trajectory.tum"))?;
        let mut text = Vec::new();
        if self.files == Files::Fomo {
            estimate = resampled(&estimate, FOMO_PERIOD_NS);
            write_tum(&estimate, &mut text)?;
            write(batch, "", &format!("{name}_{name}.txt"), &text)?;
        }
        let truth = read_trajectory(&truth_of_run(&run)?)?;
        note_time_offset(&estimate, &truth);
        let evaluation = evaluate(&estimate, &truth, STEP)?;
        let is_doubtful = evaluation.kitti.is_none() || evaluation.heading_offset_deg.is_some();
        if is_doubtful && !self.kitti.is_empty() {
            let run = run.display();
            print::note(format_args!(
                "{name}: KITTI errors are missing or invalid: `gyre evaluate {run}` gives the reason"
            ));
        }
        if self.files == Files::Kitti {
            let (estimate, truth) = (evaluation.matched.estimate(), evaluation.matched.truth());
            for (folder, poses) in [("est", estimate), ("gt", truth)] {
                text.clear();
                write_kitti(&Trajectory::untimed(poses.to_vec()), &mut text)?;
                write(batch, folder, &format!("{number:02}.txt"), &text)?;
            }
        }
        Ok(self.figures(Some(&evaluation)))
    }

    /// Returns all figures, without values if there is no evaluation.
    fn figures(&self, evaluation: Option<&Evaluation>) -> Figures {
        let mut figures = Vec::new();
        let mut add = |name: &str, value| figures.push((name.to_owned(), value));
        add("path_m", evaluation.map(|it| it.path_m));
        add("ate_m", evaluation.map(|it| it.ate.rmse_m));
        let with_kitti = evaluation.filter(|it| it.kitti.is_some());
        for (name, step) in self.kitti {
            let kitti = with_kitti.and_then(|it| kitti(&it.matched, *step));
            let [percent, degrees] = ["percent", "deg_per_100m"].map(|it| format!("{name}_{it}"));
            add(&percent, kitti.as_ref().map(|it| it.translation_percent));
            add(&degrees, kitti.map(|it| it.rotation_deg_per_100m));
        }
        if self.files == Files::Fomo {
            let fomo = evaluation.and_then(|it| fomo(&it.matched));
            add("rpe_percent", fomo.map(|it| it.rpe_percent));
            add("ape_m", fomo.map(|it| it.ape_rmse_m));
        }
        figures
    }

    /// Returns where the files are, or the command that makes them.
    fn next(&self, batch: &Path) -> String {
        let out = batch.display().to_string();
        let table = format!("table in {out}/{TABLE}");
        match (self.files, shlex::try_quote(&out)) {
            (Files::Zip(benchmark), Ok(out)) => format!(
                "{table}; the file of the benchmark is made by\n\
                 python -m gyre.boreas {out} --benchmark {benchmark} --method NAME --email ADDRESS"
            ),
            _ => format!("{table}; files in {out}/{FILES}"),
        }
    }
}

fn write(batch: &Path, folder: &str, name: &str, text: &[u8]) -> Result<(), Failure> {
    let folder = batch.join(FILES).join(folder);
    create_folder(&folder)?;
    Ok(gyre_storage::write(&folder.join(name), text)?)
}

fn aligned(table: &[Vec<String>]) -> String {
    let width = |column: usize| table.iter().map(|row| row[column].chars().count()).max();
    let cell = |(column, cell): (usize, &String)| {
        let cell = if cell.is_empty() { "-" } else { cell };
        format!("{cell:>0$}", width(column).unwrap_or(0))
    };
    let line = |row: &Vec<String>| {
        row.iter()
            .enumerate()
            .map(cell)
            .collect::<Vec<_>>()
            .join("  ")
    };
    table.iter().map(|row| line(row) + "\n").collect()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn oxford_has_the_published_figures_of_both_steps() {
        let Some(root) = std::env::var_os("GYRE_DATA").map(PathBuf::from) else {
            println!("skipped: GYRE_DATA is not set");
            return;
        };
        let read = |name| read_trajectory(&root.join("golden/kitti-metric").join(name)).unwrap();
        let [estimate, truth] = ["estimate.txt", "ground_truth.txt"].map(read);
        let evaluation = evaluate(&estimate, &truth, STEP).unwrap();
        let found = BENCHMARKS[0].figures(Some(&evaluation));
        assert_eq!(found[2].0, "hero_step4_percent");
        let found = found[2..]
            .iter()
            .map(|(_, value)| format!("{:.5}", value.unwrap()));
        let published = ["1.16084", "0.34663", "1.16688", "0.34558"];
        assert_eq!(found.collect::<Vec<_>>(), published);
    }
}
