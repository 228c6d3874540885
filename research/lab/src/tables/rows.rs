//! The rows of Table III: to add one, add it to `rows/table-iii.toml`.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::report::Record;

/// The rows, and the paper's figures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperTables {
    groups: BTreeMap<String, Vec<String>>,
    row: Vec<TableRow>,
    /// By the paper's row and the raster's side, cells.
    paper: BTreeMap<String, BTreeMap<String, Record>>,
}

/// A row: overrides of a sequence's own configuration.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableRow {
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

impl PaperTables {
    /// Reads the rows that this program has.
    pub fn read() -> Result<Self, toml::de::Error> {
        toml::from_str(include_str!("../../rows/table-iii.toml"))
    }

    /// The row of a name.
    #[cfg(test)]
    pub fn named(&self, name: &str) -> Option<&TableRow> {
        self.row.iter().find(|row| row.name == name)
    }

    /// The rows of Table IIIa.
    pub fn timed(&self) -> impl Iterator<Item = &TableRow> {
        self.row.iter().filter(|row| row.is_measured())
    }

    /// The rows of Table IIIb.
    pub fn run(&self) -> impl Iterator<Item = &TableRow> {
        self.row.iter().filter(|row| !row.mask_alone)
    }

    /// The paper's figures beside a row, for rasters of `n` cells a side.
    pub fn paper(&self, row: &TableRow, n: usize) -> Record {
        let paper = row.paper.as_ref().and_then(|row| self.paper.get(row));
        let figures = paper.and_then(|sizes| sizes.get(&n.to_string()));
        figures.cloned().unwrap_or_default()
    }
}

impl TableRow {
    /// Returns whether this program measures it; the others are the paper's alone.
    pub fn is_measured(&self) -> bool {
        self.groups.is_some()
    }

    /// Returns whether the paper has such a row.
    pub fn is_of_paper(&self) -> bool {
        self.paper.is_some()
    }

    /// Returns its overrides `section.key=value`, but for those of its network.
    pub fn changes(&self, rows: &PaperTables) -> Vec<String> {
        let groups = self.groups.iter().flatten();
        let shared = groups.filter_map(|group| rows.groups.get(group)).flatten();
        shared.chain(&self.set).cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{collections::BTreeSet, path::Path};

    use gyre_configuration::Configuration;
    use gyre_matching::RefinementKind;
    use serde_json::{Value, json};

    use super::*;
    use crate::sequence::folder;

    fn with(file: &str, changes: &[String]) -> Configuration {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        Configuration::read(&configs.join(file), changes).unwrap()
    }

    #[test]
    fn the_papers_rows_are_the_papers_configurations() {
        let rows = PaperTables::read().unwrap();
        for (name, file) in [("raw", "mbym.toml"), ("f-raw, line 14", "fast-mbym.toml")] {
            let of_file = with(file, &[]);
            let mut radiate = with("radiate.toml", &rows.named(name).unwrap().changes(&rows));
            radiate.dataset = of_file.dataset;
            // The covariances of a refinement that neither has.
            assert_eq!(radiate.odometry.refinement.kind, RefinementKind::None);
            radiate.odometry.refinement = of_file.odometry.refinement.clone();
            assert_eq!(radiate, of_file, "{name}");
        }
        assert!(rows.named("Gyre").unwrap().changes(&rows).is_empty());
    }

    #[test]
    fn masked_rows_are_their_counterparts_with_a_mask() {
        let rows = PaperTables::read().unwrap();
        for (plain, masked) in [
            ("f-raw, Eq. 7", "f-mbym, Eq. 7"),
            ("raw", "mbym"),
            ("Gyre", "Gyre, masked"),
        ] {
            let [plain, masked] = [plain, masked].map(|name| rows.named(name).unwrap());
            assert_eq!(
                masked.changes(&rows),
                plain.changes(&rows),
                "{}",
                masked.name
            );
            assert!(plain.mask.is_empty() && !masked.mask.is_empty());
        }
        let mbym = rows.named("mbym").unwrap().changes(&rows);
        assert!(mbym.contains(&"masking.threshold=0".to_owned()));
    }

    #[test]
    fn every_row_has_a_folder_of_its_own_and_names_what_there_is() {
        let rows = PaperTables::read().unwrap();
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
        let rows = PaperTables::read().unwrap();
        let names = |rows: Vec<&TableRow>| -> Vec<String> {
            rows.iter().map(|row| row.name.clone()).collect()
        };
        let (timed, run) = (names(rows.timed().collect()), names(rows.run().collect()));
        let common = ["raw", "f-raw, line 14", "f-raw, Eq. 7"];
        assert_eq!(
            (timed[0].as_str(), &timed[1..4]),
            ("mask", &common.map(str::to_owned)[..])
        );
        assert_eq!(timed[4..7], ["mbym", "f-mbym, Eq. 7", "mask, default"]);
        assert_eq!(
            (&run[..3], run[3].as_str()),
            (&common.map(str::to_owned)[..], "mbym (2019)")
        );
        assert!(run.iter().all(|name| !name.starts_with("mask")), "{run:?}");
        let paper = |row, n| Value::from(rows.paper(rows.named(row).unwrap(), n));
        let f_mbym = json!({
            "paper_laptop_hz": 20.6, "paper_jetson_hz": 6.6, "paper_percent": 2.01, "paper_deg_per_km": 6.3
        });
        assert_eq!(paper("f-mbym, Eq. 7", 255), f_mbym);
        let raw =
            json!({ "paper_laptop_hz": 0.8, "paper_percent": 5.13, "paper_deg_per_km": 17.39 });
        assert_eq!(paper("raw", 511), raw);
        assert_eq!(paper("raw", 256), json!({}));
    }
}
