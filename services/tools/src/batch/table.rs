//! The table of a batch: `results.csv` and, drive by drive in the same order, `times.csv`.

use std::path::Path;

use gyre_terminal::Failure;
use serde_json::Value;

use crate::batch::{
    List, Row, Settings,
    figures::{Column, FIGURES, TIMES},
};

/// The file of the results that follow from the drives and their configurations: the same bytes
/// whatever was killed.
pub const RESULTS: &str = "results.csv";
pub const TIMES_FILE: &str = "times.csv";

/// Writes both files from the rows of all drives of a list, which are returned.
pub fn write(list: &List, settings: &Settings, out: &Path) -> Result<Vec<Row>, Failure> {
    if !out.join("rows").is_dir() {
        let out = out.display();
        return Err(format!(
            "{out} is not the folder of a batch: no drive has been computed there"
        )
        .into());
    }
    let drives = list.drives.iter();
    let rows = drives.map(|drive| Row::read(out, drive, settings));
    let rows: Vec<Row> = rows.collect::<Result<_, _>>()?;
    let head = |row: &Row| {
        let (drive, outcome) = (&row.drive, row.outcome.to_string());
        vec![
            drive.name.clone(),
            drive.path.clone(),
            outcome,
            row.sentence.clone(),
        ]
    };
    let names = ["name", "drive", "outcome", "sentence"];
    gyre_storage::write(&out.join(RESULTS), csv(&rows, &names, head, &FIGURES)?)?;
    let head = |row: &Row| vec![row.drive.name.clone()];
    gyre_storage::write(&out.join(TIMES_FILE), csv(&rows, &["name"], head, &TIMES)?)?;
    Ok(rows)
}

/// Returns a table: of each row the first cells, then its values.
fn csv(
    rows: &[Row],
    names: &[&str],
    head: fn(&Row) -> Vec<String>,
    columns: &[Column],
) -> Result<Vec<u8>, Failure> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(names.iter().copied().chain(columns.iter().map(|it| it.0)))?;
    for row in rows {
        let values = columns.iter().map(|(name, _)| match row.values.get(*name) {
            None => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        });
        writer.write_record(head(row).into_iter().chain(values))?;
    }
    Ok(writer.into_inner()?)
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
        let settings = Settings::default();
        let mut row = Row::of(out, &list.drives[1], &settings, Outcome::NotRun, "");
        row.outcome = Outcome::Complete;
        row.values.insert("ate_rmse_m".to_owned(), 0.25.into());
        row.write(out).unwrap();
        fs::create_dir_all(out.join("drives/a/journal")).unwrap();
        fs::write(out.join("drives/a/journal/complete"), "").unwrap();
        fs::write(out.join("rows/c.json"), "{").unwrap();
        let rows = write(&list, &settings, out).unwrap();
        assert_eq!(rows[1], row);
        let damaged = rows[2].line(false);
        assert!(damaged.starts_with("c: not-run") && damaged.contains("c.json is not what"));
        let results = fs::read_to_string(out.join(RESULTS)).unwrap();
        let names = results.lines().skip(1).map(|line| &line[..1]);
        assert_eq!(names.collect::<Vec<_>>(), ["b", "a", "c"]);
        assert!(results.contains(",0.25,"), "{results}");
    }
}
