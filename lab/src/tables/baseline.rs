//! The baseline: another program that does the same searches, timed on the same machine.

use std::{fs, path::Path, process::Command};

use gyre::Failure;
use serde::Deserialize;

/// The command of the baseline.
#[derive(Clone, Copy, Debug)]
pub struct Baseline<'a> {
    /// A Python interpreter with torch.
    pub python: &'a Path,
    /// The program.
    pub script: &'a Path,
}

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

impl Baseline<'_> {
    /// Times all its rows for rasters of `n` cells a side on one thread; its exhaustive search tries `angles` angles.
    /// The report stays at `report`.
    ///
    /// # Errors
    /// A program that cannot be started, fails, or writes something else.
    pub fn time(
        &self,
        n: usize,
        passes: usize,
        angles: usize,
        report: &Path,
    ) -> Result<BaselineTimes, Failure> {
        let failed = |reason: String| format!("the baseline {} {reason}", self.script.display());
        // The report of an earlier run must not pass for this one's.
        let _ = fs::remove_file(report);
        let options =
            format!("--threads 1 --sizes {n} --passes {passes} --rotations {angles} --json");
        let output = Command::new(self.python)
            .arg(self.script)
            .args(options.split(' '))
            .arg(report)
            .output()
            .map_err(|error| failed(format!("cannot be started: {error}")))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            let last = said.lines().last().unwrap_or("it does not say why");
            return Err(failed(format!("failed: {last}")).into());
        }
        let text = fs::read_to_string(report)
            .map_err(|error| failed(format!("wrote no times: {error}")))?;
        Ok(serde_json::from_str(&text)
            .map_err(|error| failed(format!("wrote something else than times: {error}")))?)
    }
}

impl BaselineTimes {
    /// Median time of a row, ms.
    pub fn median_ms(&self, n: usize, row: &str) -> Option<f64> {
        let mut rows = self.rows.iter();
        rows.find(|time| time.n == n && time.row == row)
            .map(|time| time.median_ms)
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
        let time = |python: &str| {
            let (python, script) = (Path::new(python), Path::new("baseline.py"));
            let failed = Baseline { python, script }.time(127, 1, 31, Path::new("/nowhere/b.json"));
            failed.unwrap_err().to_string()
        };
        assert!(time("/no/python").starts_with("the baseline baseline.py cannot be started: "));
        assert_eq!(
            time("false"),
            "the baseline baseline.py failed: it does not say why"
        );
        assert!(time("true").starts_with("the baseline baseline.py wrote no times: "));
    }
}
