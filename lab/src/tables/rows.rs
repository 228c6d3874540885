//! The rows of Table III: to add one, add it to `rows/table-iii.toml`.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::models::Model;

/// The rows, and the paper's figures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rows {
    groups: BTreeMap<String, Vec<String>>,
    row: Vec<Row>,
    paper: BTreeMap<String, Paper>,
}

/// A row: overrides of a sequence's own configuration.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The name in the tables.
    pub name: String,
    /// `None`: the row is the paper's alone.
    groups: Option<Vec<String>>,
    #[serde(default)]
    set: Vec<String>,
    /// The networks that can mask it, in the order of preference; none for a row without a network.
    #[serde(default)]
    pub mask: Vec<String>,
    /// True for the mask alone: nothing is searched.
    #[serde(default)]
    pub mask_alone: bool,
    paper: Option<String>,
    /// The baseline's row that does the same.
    pub baseline: Option<String>,
}

/// A row of the paper: figures for rasters of 127, 255 and 511 cells a side, as far as they are given.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Paper {
    laptop_hz: Vec<f64>,
    jetson_hz: Vec<f64>,
    translation_percent: Vec<f64>,
    rotation_deg_per_km: Vec<f64>,
}

/// The papers' tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// IIIa.
    Times,
    /// IIIb.
    Accuracy,
}

impl Rows {
    /// Reads the rows that this program has.
    ///
    /// # Errors
    /// A mistake in `rows/table-iii.toml`.
    pub fn read() -> Result<Self, toml::de::Error> {
        toml::from_str(include_str!("../../rows/table-iii.toml"))
    }

    /// The row of a name.
    pub fn named(&self, name: &str) -> Option<&Row> {
        self.row.iter().find(|row| row.name == name)
    }

    /// The rows of a table, in their order.
    pub fn of(&self, table: Table) -> impl Iterator<Item = &Row> {
        self.row
            .iter()
            .filter(move |row| match (self.paper(row), table) {
                (Some(paper), Table::Times) => !paper.laptop_hz.is_empty(),
                (Some(paper), Table::Accuracy) => !paper.translation_percent.is_empty(),
                (None, Table::Times) => true,
                (None, Table::Accuracy) => !row.mask_alone,
            })
    }

    /// The paper's two figures beside a row in a table, for rasters of `n` cells a side.
    pub fn figures(&self, row: &Row, table: Table, n: usize) -> [Option<f64>; 2] {
        let paper = |paper: &Paper| {
            let size = [127, 255, 511].iter().position(|size| *size == n)?;
            let figures = match table {
                Table::Times => [&paper.laptop_hz, &paper.jetson_hz],
                Table::Accuracy => [&paper.translation_percent, &paper.rotation_deg_per_km],
            };
            Some(figures.map(|figures| figures.get(size).copied()))
        };
        self.paper(row).and_then(paper).unwrap_or_default()
    }

    fn paper(&self, row: &Row) -> Option<&Paper> {
        self.paper.get(row.paper.as_ref()?)
    }
}

impl Row {
    /// Returns whether this program measures it; the others are the paper's alone.
    pub fn is_measured(&self) -> bool {
        self.groups.is_some()
    }

    /// Returns whether the paper has such a row.
    pub fn is_of_paper(&self) -> bool {
        self.paper.is_some()
    }

    /// Returns its overrides `section.key=value`, masked by this network if there is one.
    pub fn changes(&self, rows: &Rows, model: Option<&Model>) -> Vec<String> {
        let groups = self.groups.iter().flatten();
        let shared = groups.filter_map(|group| rows.groups.get(group)).flatten();
        let own = shared.chain(&self.set).cloned();
        own.chain(model.into_iter().flat_map(Model::changes))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{collections::BTreeSet, path::Path};

    use gyre::configuration::Configuration;

    use super::*;
    use crate::report::folder;

    fn with(file: &str, changes: &[String]) -> Configuration {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
        Configuration::read(&configs.join(file), changes).unwrap()
    }

    #[test]
    fn the_papers_rows_are_the_papers_configurations() {
        let rows = Rows::read().unwrap();
        for (name, file) in [("raw", "mbym.toml"), ("f-raw, line 14", "fast-mbym.toml")] {
            let of_file = with(file, &[]);
            let mut radiate = with(
                "radiate.toml",
                &rows.named(name).unwrap().changes(&rows, None),
            );
            radiate.dataset = of_file.dataset;
            assert_eq!(radiate, of_file, "{name}");
        }
        assert!(rows.named("Gyre").unwrap().changes(&rows, None).is_empty());
    }

    #[test]
    fn masked_rows_are_their_counterparts_with_a_mask() {
        let rows = Rows::read().unwrap();
        for (plain, masked) in [
            ("f-raw, Eq. 7", "f-mbym, Eq. 7"),
            ("raw", "mbym"),
            ("Gyre", "Gyre, masked"),
        ] {
            let [plain, masked] = [plain, masked].map(|name| rows.named(name).unwrap());
            let mut found = with("radiate.toml", &masked.changes(&rows, None));
            found.odometry.masking.threshold = with("radiate.toml", &[]).odometry.masking.threshold;
            assert_eq!(
                found,
                with("radiate.toml", &plain.changes(&rows, None)),
                "{}",
                masked.name
            );
            assert!(plain.mask.is_empty() && !masked.mask.is_empty());
        }
        // With a mask the floor is the threshold.
        let mbym = rows.named("mbym").unwrap().changes(&rows, None);
        assert!(mbym.contains(&"masking.threshold=0".to_owned()));
    }

    #[test]
    fn every_row_has_a_folder_of_its_own_and_names_what_there_is() {
        let rows = Rows::read().unwrap();
        let folders: BTreeSet<String> = rows.row.iter().map(|row| folder(&row.name)).collect();
        assert_eq!(folders.len(), rows.row.len());
        for row in &rows.row {
            let mut groups = row.groups.iter().flatten();
            assert!(
                groups.all(|group| rows.groups.contains_key(group)),
                "{}",
                row.name
            );
            assert!(
                row.paper
                    .as_ref()
                    .is_none_or(|paper| rows.paper.contains_key(paper))
            );
            assert!(row.is_measured() || row.is_of_paper(), "{}", row.name);
        }
    }

    #[test]
    fn each_table_has_its_rows_with_the_papers_figures_at_three_sizes() {
        let rows = Rows::read().unwrap();
        let names = |table| {
            rows.of(table)
                .map(|row| row.name.as_str())
                .collect::<Vec<_>>()
        };
        let common = ["raw", "f-raw, line 14", "f-raw, Eq. 7"];
        assert_eq!(names(Table::Times)[1..4], common);
        assert_eq!(
            names(Table::Times)[4..7],
            ["mbym", "f-mbym, Eq. 7", "mask, default"]
        );
        let accuracy = names(Table::Accuracy);
        assert_eq!((&accuracy[..3], accuracy[3]), (&common[..], "mbym (2019)"));
        assert!(
            accuracy.iter().all(|name| !name.starts_with("mask")),
            "{accuracy:?}"
        );
        let f_mbym = rows.named("f-mbym, Eq. 7").unwrap();
        assert_eq!(
            rows.figures(f_mbym, Table::Times, 255),
            [Some(20.6), Some(6.6)]
        );
        assert_eq!(
            rows.figures(f_mbym, Table::Accuracy, 255),
            [Some(2.01), Some(6.3)]
        );
        let raw = rows.named("raw").unwrap();
        assert_eq!(rows.figures(raw, Table::Times, 511), [Some(0.8), None]);
        assert_eq!(rows.figures(raw, Table::Times, 256), [None; 2]);
    }
}
