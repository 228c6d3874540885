//! The loops of a run, from its `loops.csv`.

use std::path::Path;

use gyre_configuration::terminal::Failure;
use gyre_results::evaluate::rows;
use gyre_slam::LoopVerdict;
use serde::Deserialize;

#[derive(Deserialize)]
struct LoopRow {
    scan: u64,
    found_scan: u64,
    verdict: String,
}

/// Returns the scans of both keyframes of each loop that is used; none without the file.
pub fn used_loops(path: &Path) -> Result<Vec<[u64; 2]>, Failure> {
    if !super::exists(path)? {
        return Ok(Vec::new());
    }
    let used = LoopVerdict::Used.to_string();
    let rows = rows::<LoopRow>(path)?.into_iter();
    let rows = rows.filter(|row| row.verdict == used);
    Ok(rows.map(|row| [row.found_scan, row.scan]).collect())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn loops_that_are_used_are_read_by_the_names_of_their_columns() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loops.csv");
        assert!(used_loops(&path).unwrap().is_empty());
        fs::write(
            &path,
            "scan,found_scan,weight,verdict\n9,2,1.0,used\n9,3,,ambiguous\n12,2,0.5,used\n",
        )
        .unwrap();
        assert_eq!(used_loops(&path).unwrap(), [[2, 9], [2, 12]]);
        fs::write(&path, "scan,found_scan,verdict\n9,two,used\n").unwrap();
        let refused = used_loops(&path).unwrap_err().to_string();
        assert!(refused.contains("loops.csv") && refused.contains("line: 2"));
    }
}
