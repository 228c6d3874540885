//! The peer: another program that does the same searches, timed on the same machine.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde::Deserialize;

use gyre::Failure;

/// How to start the peer.
#[derive(Debug)]
pub struct Peer {
    python: PathBuf,
    script: PathBuf,
}

/// What the peer writes.
#[derive(Debug, Deserialize)]
pub struct PeerTimes {
    /// Its version of PyTorch.
    pub torch: String,
    rows: Vec<PeerRow>,
}

#[derive(Debug, Deserialize)]
struct PeerRow {
    n: usize,
    row: String,
    median_ms: f64,
}

impl Peer {
    /// An interpreter and a script, where both are given.
    pub fn new(python: Option<&Path>, script: Option<&Path>) -> Option<Self> {
        Some(Self {
            python: python?.to_owned(),
            script: script?.to_owned(),
        })
    }

    /// Times all its rows for rasters of `n` cells a side on one thread; its exhaustive search tries `angles` angles.
    /// What it writes stays at `report`.
    pub fn time(
        &self,
        n: usize,
        passes: usize,
        angles: usize,
        report: &Path,
    ) -> Result<PeerTimes, Failure> {
        let failed = |reason: String| format!("the peer {} {reason}", self.script.display());
        let mut command = Command::new(&self.python);
        command
            .arg(&self.script)
            .args(["--threads", "1", "--sizes", &n.to_string()]);
        command
            .args([
                "--passes",
                &passes.to_string(),
                "--rotations",
                &angles.to_string(),
                "--json",
            ])
            .arg(report);
        // What an earlier run left must not pass for this one's.
        let _ = fs::remove_file(report);
        let output = command
            .output()
            .map_err(|error| failed(format!("cannot be started: {error}")))?;
        if !output.status.success() {
            let told = String::from_utf8_lossy(&output.stderr);
            return Err(failed(format!(
                "failed: {}",
                told.lines().last().unwrap_or("it does not say why")
            ))
            .into());
        }
        let text = fs::read_to_string(report)
            .map_err(|error| failed(format!("wrote no times: {error}")))?;
        Ok(serde_json::from_str(&text)
            .map_err(|error| failed(format!("wrote something else than times: {error}")))?)
    }
}

impl PeerTimes {
    /// Median time of a row, ms.
    pub fn median_ms(&self, n: usize, row: &str) -> Option<f64> {
        self.rows
            .iter()
            .find(|time| time.n == n && time.row == row)
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
        let times: PeerTimes = serde_json::from_str(text).unwrap();
        assert_eq!(times.median_ms(127, "raw"), Some(90.5));
        assert_eq!(times.median_ms(255, "f-raw"), Some(17.25));
        assert_eq!(
            (times.median_ms(255, "raw"), times.median_ms(255, "mbym")),
            (None, None)
        );
    }

    #[test]
    fn a_peer_that_cannot_be_used_says_so() {
        let time = |python: &str| {
            let peer = Peer::new(Some(Path::new(python)), Some(Path::new("peer.py"))).unwrap();
            peer.time(127, 1, 31, Path::new("/nowhere/peer.json"))
                .unwrap_err()
                .to_string()
        };
        assert!(time("/no/python").starts_with("the peer peer.py cannot be started: "));
        assert_eq!(
            time("false"),
            "the peer peer.py failed: it does not say why"
        );
        assert!(time("true").starts_with("the peer peer.py wrote no times: "));
    }
}
