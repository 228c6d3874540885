//! The table of a batch: `results.csv` and, drive by drive in the same order, `times.csv`.

use std::{collections::BTreeMap, path::Path};

use serde_json::Value;

use crate::{
    BatchError, Drive, DriveOutcome, DriveRow, List, Settings, Values,
    columns::{self, Column},
};

/// The file of the results that follow from the drives and their configurations: the same bytes
/// whatever was killed.
pub const RESULTS: &str = "results.csv";
/// The file of all others.
pub const TIMES: &str = "times.csv";

/// The rows of all drives of a list, in its order.
#[derive(Clone, Debug)]
pub struct Table {
    rows: Vec<DriveRow>,
}

/// Reads the row of each drive in the folder of a batch.
///
/// # Errors
/// There is no batch, or a row that cannot be read.
pub fn collect(list: &List, settings: &Settings, out: &Path) -> Result<Table, BatchError> {
    if !out.join("rows").is_dir() {
        return Err(BatchError::NoBatch {
            path: out.to_owned(),
        });
    }
    let row = |drive: &Drive| row(drive, settings, out);
    let rows: Result<_, _> = list.drives().iter().map(row).collect();
    Ok(Table { rows: rows? })
}

fn row(drive: &Drive, settings: &Settings, out: &Path) -> Result<DriveRow, BatchError> {
    Ok(match DriveRow::read(out, drive) {
        Ok(Some(row)) if row.is_of(drive, settings) => match row.outcome.has_results() {
            true if !row.has_its_results(out) => DriveRow::not_run(
                drive,
                settings,
                "its results are being computed anew, or were removed",
            ),
            _ => row,
        },
        Ok(Some(_)) => DriveRow::not_run(drive, settings, "it was computed with other settings"),
        Ok(None) => DriveRow::not_run(drive, settings, "it has not been computed yet"),
        Err(error @ BatchError::Unknown { .. }) => {
            DriveRow::not_run(drive, settings, &error.to_string())
        }
        Err(error) => return Err(error),
    })
}

impl Table {
    /// Returns the number of drives by outcome.
    pub fn counts(&self) -> BTreeMap<DriveOutcome, usize> {
        let mut counts = BTreeMap::new();
        for row in &self.rows {
            *counts.entry(row.outcome).or_default() += 1;
        }
        counts
    }

    /// Returns the drives that are not complete, a line each.
    pub fn failures(&self) -> impl Iterator<Item = String> {
        let failed = |row: &&DriveRow| row.outcome != DriveOutcome::Complete;
        self.rows.iter().filter(failed).map(|row| {
            let DriveRow {
                drive,
                outcome,
                sentence,
                ..
            } = row;
            format!("{}: {outcome}: {sentence}", drive.name)
        })
    }

    /// Returns the builds of the program that the results are of, if there are several.
    pub fn builds(&self) -> Vec<&str> {
        let builds = self
            .rows
            .iter()
            .filter_map(|row| row.figures.get("build")?.as_str());
        let mut builds: Vec<_> = builds.collect();
        builds.sort_unstable();
        builds.dedup();
        builds
    }

    /// Writes both files, each as a whole.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, out: &Path) -> Result<(), BatchError> {
        let results = csv(
            &["name", "drive", "outcome", "sentence"],
            &columns::FIGURES,
            self.rows.iter().map(|row| {
                let DriveRow {
                    drive,
                    outcome,
                    sentence,
                    figures,
                    ..
                } = row;
                let head = [&drive.name, &drive.path, outcome.name(), sentence];
                (head.map(str::to_owned).to_vec(), figures)
            }),
        )?;
        let times = self.rows.iter();
        let times = times.map(|row| (vec![row.drive.name.clone()], &row.times));
        gyre_storage::write(&out.join(RESULTS), results)?;
        let times = csv(&["name"], &columns::TIMES, times)?;
        Ok(gyre_storage::write(&out.join(TIMES), times)?)
    }
}

/// Returns a table: of each row the first cells and its values.
fn csv<'a>(
    head: &[&str],
    columns: &[Column],
    rows: impl Iterator<Item = (Vec<String>, &'a Values)>,
) -> Result<Vec<u8>, BatchError> {
    let cell = |value: Option<&Value>| match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    };
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(head.iter().copied().chain(columns.iter().map(|it| it.0)))?;
    for (mut cells, values) in rows {
        cells.extend(columns.iter().map(|(name, _)| cell(values.get(*name))));
        writer.write_record(cells)?;
    }
    writer
        .into_inner()
        .map_err(|error| csv::Error::from(error.into_error()).into())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;

    #[test]
    fn the_table_has_a_line_for_each_drive_in_the_order_of_the_list() {
        let out = tempfile::tempdir().unwrap();
        let path = out.path().join("list.txt");
        fs::write(&path, "b\na\nc\n").unwrap();
        let list = List::read(&path).unwrap();
        fs::create_dir(out.path().join("rows")).unwrap();
        let settings = Settings::default();
        let [b, a, c] = list.drives() else {
            panic!("{list:?}")
        };
        let mut row = DriveRow::not_run(a, &settings, "");
        row.outcome = DriveOutcome::Complete;
        let set = |values: &mut Values, name: &str, value| values.insert(name.to_owned(), value);
        set(&mut row.figures, "ate_rmse_m", 0.25.into());
        set(&mut row.figures, "build", "0a1b".into());
        set(&mut row.times, "restarts", 2.into());
        row.write(out.path()).unwrap();
        let without = collect(&list, &settings, out.path()).unwrap();
        assert!(
            without
                .failures()
                .any(|line| line.contains("a: not-run: its results"))
        );
        let results = out.path().join("drives/a/journal");
        fs::create_dir_all(&results).unwrap();
        fs::write(results.join("complete"), "").unwrap();
        let other = Settings {
            set: vec!["raster.n=127".to_owned()],
            ..settings.clone()
        };
        DriveRow::not_run(b, &other, "").write(out.path()).unwrap();
        fs::write(DriveRow::path(out.path(), c), "{").unwrap();

        let table = collect(&list, &settings, out.path()).unwrap();
        table.write(out.path()).unwrap();
        assert_eq!(table.builds(), ["0a1b"]);
        let mut results = csv::Reader::from_path(out.path().join(RESULTS)).unwrap();
        let header = results.headers().unwrap().clone();
        let column = |name| header.iter().position(|column| column == name).unwrap();
        let records: Vec<_> = results.records().map(Result::unwrap).collect();
        let cells = |name| -> Vec<String> {
            records
                .iter()
                .map(|it| it[column(name)].to_owned())
                .collect()
        };
        assert_eq!(cells("name"), ["b", "a", "c"]);
        assert_eq!(cells("outcome"), ["not-run", "complete", "not-run"]);
        assert_eq!(cells("ate_rmse_m"), ["", "0.25", ""]);
        assert!(cells("sentence")[0].contains("other settings"));
        assert!(cells("sentence")[2].contains("c.json is not what"));
        let times = fs::read_to_string(out.path().join(TIMES)).unwrap();
        assert_eq!(times.lines().count(), 4);
        assert_eq!(table.failures().count(), 2);
    }
}
