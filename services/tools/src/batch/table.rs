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
    fn the_table_has_a_line_for_each_drive_in_the_order_of_the_list() {
        let folder = tempfile::tempdir().unwrap();
        let (out, path) = (folder.path(), folder.path().join("list.txt"));
        fs::write(&path, "b\na\nc\n").unwrap();
        let list = List::read(&path).unwrap();
        fs::create_dir(out.join("rows")).unwrap();
        let settings = Settings::default();
        let [b, a] = [0, 1].map(|index: usize| &list.drives[index]);
        let row = Row::of(out, a, &settings, Outcome::Complete, "");
        assert_eq!(row.outcome, Outcome::Failed);
        assert!(row.sentence.contains("summary.json"), "{}", row.sentence);
        let mut row = Row::of(out, a, &settings, Outcome::NotRun, "");
        row.outcome = Outcome::Complete;
        row.values.insert("ate_rmse_m".to_owned(), 0.25.into());
        row.write(out).unwrap();
        let without = write(&list, &settings, out).unwrap();
        assert!(without[1].line(false).contains("a: not-run: its results"));
        fs::create_dir_all(out.join("drives/a/journal")).unwrap();
        fs::write(out.join("drives/a/journal/complete"), "").unwrap();
        assert_eq!(Row::read(out, a, &settings).unwrap(), row);
        let set = vec!["raster.n=127".to_owned()];
        let other = Settings {
            set,
            ..settings.clone()
        };
        let row = Row::of(out, b, &other, Outcome::Failed, "");
        row.write(out).unwrap();
        fs::write(out.join("rows/c.json"), "{").unwrap();

        write(&list, &settings, out).unwrap();
        let mut results = csv::Reader::from_path(out.join(RESULTS)).unwrap();
        let header = results.headers().unwrap().clone();
        let records: Vec<_> = results.records().map(Result::unwrap).collect();
        let cells = |name| {
            let column = header.iter().position(|column| column == name).unwrap();
            [0, 1, 2].map(|row: usize| &records[row][column])
        };
        assert_eq!(cells("name"), ["b", "a", "c"]);
        assert_eq!(cells("outcome"), ["not-run", "complete", "not-run"]);
        assert_eq!(cells("ate_rmse_m"), ["", "0.25", ""]);
        assert!(cells("sentence")[0].contains("other settings"));
        assert!(cells("sentence")[2].contains("c.json is not what"));
        let times = fs::read_to_string(out.join(TIMES_FILE)).unwrap();
        assert_eq!(times.lines().count(), 4);
    }
}
