//! The table of a batch: `results.csv` and, drive by drive in the same order, `times.csv`.

use std::path::Path;

use gyre_terminal::Failure;
use serde_json::Value;

use crate::batch::{
    List, Row,
    figures::{Column, FIGURES, TIMES},
};

/// The file of the results that follow from the drives and their configurations: the same bytes
/// whatever was killed.
pub const RESULTS: &str = "results.csv";
pub const TIMES_FILE: &str = "times.csv";

/// Returns the rows of all drives of a list.
pub fn read(list: &List, out: &Path) -> Result<Vec<Row>, Failure> {
    if !out.join("rows").is_dir() {
        let out = out.display();
        return Err(format!(
            "{out} is not the folder of a batch: no drive has been computed there"
        )
        .into());
    }
    let drives = list.drives.iter();
    Ok(drives.map(|drive| Row::read(out, drive)).collect())
}

/// Writes both files.
pub fn write(rows: &[Row], out: &Path) -> Result<(), Failure> {
    let first = ["name", "drive", "outcome", "sentence"];
    gyre_storage::write(&out.join(RESULTS), csv(rows, &first, &FIGURES)?)?;
    let times = csv(rows, &["name"], &TIMES)?;
    Ok(gyre_storage::write(&out.join(TIMES_FILE), times)?)
}

fn csv(rows: &[Row], first: &[&str], columns: &[Column]) -> Result<Vec<u8>, Failure> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names = first.iter().copied().chain(columns.iter().map(|it| it.0));
    writer.write_record(names.clone())?;
    for row in rows {
        writer.write_record(names.clone().map(|name| cell(row, name)))?;
    }
    Ok(writer.into_inner()?)
}

fn cell(row: &Row, column: &str) -> String {
    match (column, row.values.get(column)) {
        ("name", _) => row.drive.name.clone(),
        ("drive", _) => row.drive.path.clone(),
        ("outcome", _) => row.outcome.to_string(),
        ("sentence", _) => row.sentence.clone(),
        (_, None) => String::new(),
        (_, Some(Value::String(text))) => text.clone(),
        (_, Some(other)) => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;
    use crate::batch::Outcome;

    #[test]
    fn the_table_has_a_line_for_each_drive_and_a_damaged_row_counts_as_not_run() {
        let folder = tempfile::tempdir().unwrap();
        let (out, path) = (folder.path(), folder.path().join("list.txt"));
        fs::write(&path, "b\na\nc\n").unwrap();
        let list = List::read(&path).unwrap();
        fs::create_dir(out.join("rows")).unwrap();
        let log = out.join("drives/a/log.jsonl");
        let sentence = format!("no {}", log.display());
        let mut row = Row::of(out, &list.drives[1], Outcome::NotRun, sentence);
        assert_eq!(row.sentence, "no drives/a/log.jsonl");
        row.outcome = Outcome::Complete;
        row.values.insert("ate_rmse_m".to_owned(), 0.25.into());
        row.write(out).unwrap();
        fs::create_dir_all(out.join("drives/a/journal")).unwrap();
        fs::write(out.join("drives/a/journal/complete"), "").unwrap();
        fs::write(out.join("rows/c.json"), "{").unwrap();
        let rows = read(&list, out).unwrap();
        write(&rows, out).unwrap();
        assert_eq!(rows[1], row);
        let damaged = rows[2].line(false);
        assert!(damaged.starts_with("c: not-run") && damaged.contains("c.json is not what"));
        let results = fs::read_to_string(out.join(RESULTS)).unwrap();
        let names = results.lines().skip(1).map(|line| &line[..1]);
        assert_eq!(names.collect::<Vec<_>>(), ["b", "a", "c"]);
        assert!(results.contains(",0.25,"), "{results}");
    }
}
