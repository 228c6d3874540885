//! The baseline: another program that does the same searches, timed on the same machine.

use std::{fs, path::Path, process::Command};

use gyre_configuration::terminal::Failure;
use serde::Deserialize;

use crate::{cli::TablesArguments, sequence::Sequence};

/// The report of the baseline.
#[derive(Debug, Deserialize)]
pub struct BaselineTimes {
    /// The version of PyTorch.
    pub torch: String,
    rows: Vec<BaselineRow>,
}

#[derive(Debug, Deserialize)]
struct BaselineRow {
    n: usize,
    row: String,
    median_ms: f64,
}

/// Times all rows of the baseline that is named, if one is, for rasters of `n` cells a side on one
/// thread; its exhaustive search tries as many angles as the sequence's. The report stays in the
/// folder of the tables.
///
/// # Errors
/// A program that cannot be started, fails, or writes something else.
pub fn time(
    sequence: &Sequence,
    n: usize,
    arguments: &TablesArguments,
) -> Result<Option<BaselineTimes>, Failure> {
    let [python, script] = [&arguments.baseline, &arguments.baseline_script];
    let (Some(python), Some(script)) = (python, script) else {
        return Ok(None);
    };
    let (odometry, passes) = (
        sequence.configuration(&[])?.odometry,
        2 * arguments.passes.get(),
    );
    let angles = odometry.exhaustive.candidates();
    let report = arguments.out.join(format!("baseline-{n}.json"));
    let options = format!("--threads 1 --sizes {n} --passes {passes} --rotations {angles} --json");
    let mut command = Command::new(python);
    command.arg(script).args(options.split(' ')).arg(&report);
    let failed = |reason| format!("the baseline {} {reason}", script.display());
    Ok(Some(times_of(command, &report).map_err(failed)?))
}

fn times_of(mut command: Command, report: &Path) -> Result<BaselineTimes, String> {
    // The report of an earlier run must not pass for this one's.
    let _ = fs::remove_file(report);
    let output = command.output();
    let output = output.map_err(|error| format!("cannot be started: {error}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().last().unwrap_or("it does not say why");
        return Err(format!("failed: {last}"));
    }
    let text = fs::read_to_string(report);
    let text = text.map_err(|error| format!("wrote no times: {error}"))?;
    let other = |error| format!("wrote something else than times: {error}");
    serde_json::from_str(&text).map_err(other)
}

impl BaselineTimes {
    /// Median time of a row, ms.
    pub fn median_ms(&self, n: usize, row: &str) -> Option<f64> {
        let mut rows = self.rows.iter().filter(|time| time.n == n);
        Some(rows.find(|time| time.row == row)?.median_ms)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn times_are_found_by_size_and_row() {
        let text = r#"{"machine": "x", "torch": "2.4", "threads": 1, "rows": [
            {"n": 127, "row": "raw", "median_ms": 90.5, "mean_ms": 91.0, "hz": 11.0, "ms_per_rotation": 2.9},
            {"n": 255, "row": "f-raw", "median_ms": 17.25, "mean_ms": 17.0, "hz": 58.8}]}"#;
        let times: BaselineTimes = serde_json::from_str(text).unwrap();
        assert_eq!(times.median_ms(127, "raw"), Some(90.5));
        assert_eq!(times.median_ms(255, "f-raw"), Some(17.25));
        assert_eq!(times.median_ms(255, "raw"), None);
        assert_eq!(times.median_ms(255, "mbym"), None);
    }

    #[test]
    fn a_baseline_that_cannot_be_used_says_so() {
        let failed = |python: &str| {
            let times = times_of(Command::new(python), Path::new("/nowhere/b.json"));
            times.unwrap_err()
        };
        assert!(failed("/no/python").starts_with("cannot be started: "));
        assert_eq!(failed("false"), "failed: it does not say why");
        assert!(failed("true").starts_with("wrote no times: "));
    }
}
