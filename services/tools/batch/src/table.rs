//! The table of a batch: `results.csv` and, drive by drive in the same order, `times.csv`.

use std::{collections::BTreeMap, path::Path};

use serde::Serialize;

use crate::{BatchError, Drive, List, Outcome, Row, Settings};

/// What follows from the drives and their configurations: the same bytes whatever was killed.
pub const RESULTS: &str = "results.csv";
/// What does not.
pub const TIMES: &str = "times.csv";

/// The rows of all drives of a list, in its order.
#[derive(Clone, Debug)]
pub struct Table {
    rows: Vec<Row>,
}

/// The first columns of the results.
#[derive(Serialize)]
struct Head<'a> {
    name: &'a str,
    drive: &'a str,
    outcome: Outcome,
    sentence: &'a str,
}

/// The first columns of the times.
#[derive(Serialize)]
struct Name<'a> {
    name: &'a str,
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

fn row(drive: &Drive, settings: &Settings, out: &Path) -> Result<Row, BatchError> {
    Ok(match Row::read(out, drive) {
        Ok(Some(row)) if row.is_of(drive, settings) => match row.outcome.has_results() {
            true if !row.has_its_results(out) => Row::not_run(
                drive,
                settings,
                "its results are being computed anew, or were removed",
            ),
            _ => row,
        },
        Ok(Some(_)) => Row::not_run(drive, settings, "it was computed with other settings"),
        Ok(None) => Row::not_run(drive, settings, "it has not been computed yet"),
        Err(error @ BatchError::Unknown { .. }) => {
            Row::not_run(drive, settings, &error.to_string())
        }
        Err(error) => return Err(error),
    })
}

impl Table {
    /// Returns the number of drives by outcome.
    pub fn counts(&self) -> BTreeMap<Outcome, usize> {
        let mut counts = BTreeMap::new();
        for row in &self.rows {
            *counts.entry(row.outcome).or_default() += 1;
        }
        counts
    }

    /// Returns the drives that are not complete, a line each.
    pub fn failures(&self) -> impl Iterator<Item = String> {
        let failed = |row: &&Row| row.outcome != Outcome::Complete;
        self.rows.iter().filter(failed).map(|row| {
            let Row {
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
            .filter_map(|row| row.figures.build.as_deref());
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
        let results = csv(self.rows.iter().map(|row| {
            let head = Head {
                name: &row.drive.name,
                drive: &row.drive.path,
                outcome: row.outcome,
                sentence: &row.sentence,
            };
            (head, &row.figures)
        }))?;
        let times = self.rows.iter().map(|row| {
            let name = &row.drive.name;
            (Name { name }, &row.times)
        });
        gyre_storage::write(&out.join(RESULTS), results)?;
        Ok(gyre_storage::write(&out.join(TIMES), csv(times)?)?)
    }
}

fn csv(rows: impl Iterator<Item = impl Serialize>) -> Result<Vec<u8>, BatchError> {
    let mut bytes = Vec::new();
    let mut writer = csv::Writer::from_writer(&mut bytes);
    for row in rows {
        writer.serialize(row)?;
    }
    writer.flush().map_err(csv::Error::from)?;
    drop(writer);
    Ok(bytes)
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
        let mut row = Row::not_run(a, &settings, "");
        row.outcome = Outcome::Complete;
        row.figures.ate_rmse_m = Some(0.25);
        row.figures.build = Some("0a1b".to_owned());
        row.times.restarts = Some(2);
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
        Row::not_run(b, &other, "").write(out.path()).unwrap();
        fs::write(Row::path(out.path(), c), "{").unwrap();

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
