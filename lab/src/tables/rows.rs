//! The rows of both tables: to add one, add a line to [`ROWS`].

use crate::tables::{
    models::{Mask, Model},
    papers::{FIGURES, Figures},
};

/// A way to find motions: what it changes in a sequence's own configuration.
#[derive(Debug)]
pub struct Row {
    /// What it is called.
    pub name: &'static str,
    /// The papers' row that it stands for.
    pub paper: Option<&'static str>,
    /// The peer's row that does the same.
    pub peer: Option<&'static str>,
    /// The network that masks, where one does.
    pub mask: Option<Mask>,
    /// Whether it is the mask alone: nothing is searched.
    pub mask_alone: bool,
    /// `--set` sentences, group by group.
    changes: &'static [&'static [&'static str]],
}

/// All rows that this program can measure.
pub static ROWS: [Row; 13] = [
    Row::of_papers("mask", "mask", "mask", &[PAPERS_RASTER, ALL_IS_SEEN])
        .masked(OF_FAST_MBYM)
        .alone(),
    Row::of_papers("raw", "raw", "raw", &[PAPERS_RASTER, RAW]),
    Row::of_papers(
        "f-raw, line 14",
        "f-raw",
        "f-raw",
        &[PAPERS_RASTER, F_RAW, &["rotation.form=line14"]],
    ),
    Row::of_papers(
        "f-raw, Eq. 7",
        "f-raw",
        "f-raw-eq7",
        &[PAPERS_RASTER, F_RAW, EQ_7],
    ),
    Row::of_papers("mbym", "mbym", "mbym", &[PAPERS_RASTER, ALL_IS_SEEN, RAW]).masked(OF_MBYM),
    Row::of_papers(
        "f-mbym, Eq. 7",
        "f-mbym",
        "f-mbym",
        &[PAPERS_RASTER, ALL_IS_SEEN, F_RAW, EQ_7],
    )
    .masked(OF_FAST_MBYM),
    Row {
        peer: Some("mask"),
        ..Row::of_gyre("mask, default", &[])
            .masked(Mask::Product)
            .alone()
    },
    Row::of_gyre(
        "Gyre, every angle",
        &[&["search.kind=exhaustive"], SEARCH_ALONE],
    ),
    Row::of_gyre("Gyre, search alone", &[SEARCH_ALONE]),
    Row::of_gyre("Gyre, search alone, masked", &[SEARCH_ALONE]).masked(Mask::Product),
    Row::of_gyre("Gyre, refined", &[LAST_KEYFRAME]),
    Row::of_gyre("Gyre", &[]),
    Row::of_gyre("Gyre, masked", &[]).masked(Mask::Product),
];

/// The row of Fast-MbyM's own form.
pub static PLAIN: &Row = &ROWS[2];

/// The row of a sequence's own configuration.
pub static SHIPPED: &Row = &ROWS[11];

/// Networks that are trained through the decoupled search, and those through the exhaustive one; the former can stand in for the
/// latter.
const OF_FAST_MBYM: Mask = Mask::OfSize(&["f-mbym"]);
const OF_MBYM: Mask = Mask::OfSize(&["mbym", "f-mbym"]);

/// Two scans and no more: the motion is the search's.
const SEARCH_ALONE: &[&str] = &["refinement.kind=none"];

/// Refined, but against the last keyframe instead of a map.
const LAST_KEYFRAME: &[&str] = &["refinement.keyframes=1"];

/// No mask, no compensation, no refinement, 102 m a side.
const PAPERS_RASTER: &[&str] = &[
    "raster.n=255",
    "raster.cell_m=0.4",
    "raster.sampling=bilinear",
    "points.capacity=0",
    "masking.kind=none",
    "masking.compensate=false",
    "refinement.kind=none",
];

/// The papers' networks see the noise too.
const ALL_IS_SEEN: &[&str] = &["masking.threshold=0"];

const EQ_7: &[&str] = &["rotation.form=eq7"];

/// As `configs/mbym.toml`.
const RAW: &[&str] = &[
    "search.kind=exhaustive",
    "exhaustive.overlap=none",
    "exhaustive.peak=parabola",
];

/// As `configs/fast-mbym.toml`, but for the form.
pub const F_RAW: &[&str] = &[
    "rotation.window=hann",
    "rotation.band_low=0.01",
    "rotation.band_high=0.35",
    "rotation.angles=733",
    "rotation.radii=127",
    "rotation.peak=parabola",
    "translation.overlap=none",
    "translation.peak=parabola",
];

impl Row {
    const fn of_papers(
        name: &'static str,
        paper: &'static str,
        peer: &'static str,
        changes: &'static [&'static [&'static str]],
    ) -> Self {
        Self {
            name,
            paper: Some(paper),
            peer: Some(peer),
            mask: None,
            mask_alone: false,
            changes,
        }
    }

    const fn of_gyre(name: &'static str, changes: &'static [&'static [&'static str]]) -> Self {
        Self {
            name,
            paper: None,
            peer: None,
            mask: None,
            mask_alone: false,
            changes,
        }
    }

    const fn masked(self, mask: Mask) -> Self {
        Self {
            mask: Some(mask),
            ..self
        }
    }

    const fn alone(self) -> Self {
        Self {
            mask_alone: true,
            ..self
        }
    }

    /// What it changes but for the mask, as sentences `section.key=value`.
    pub fn changes(&self) -> Vec<String> {
        self.changes
            .iter()
            .copied()
            .flatten()
            .map(|sentence| (*sentence).to_owned())
            .collect()
    }

    /// The same with its mask.
    pub fn changes_with(&self, model: Option<&Model>) -> Vec<String> {
        self.changes()
            .into_iter()
            .chain(model.into_iter().flat_map(Model::changes))
            .collect()
    }

    /// Its name as that of a folder.
    pub fn folder(&self) -> String {
        folder(self.name)
    }
}

/// A name as that of a folder.
pub fn folder(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            '-'
        }
    };
    let mut name: String = name.chars().map(plain).collect();
    while name.contains("--") {
        name = name.replace("--", "-");
    }
    name
}

/// A line of a table: a row of ours, a row of the papers, or both.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// What stands in front.
    pub name: &'static str,
    /// Ours; `None` where this program has nothing of the kind.
    pub row: Option<&'static Row>,
    /// The papers'.
    pub figures: Option<&'static Figures>,
    /// The peer's row.
    pub peer: Option<&'static str>,
}

/// The papers' tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// IIIa.
    Times,
    /// IIIb.
    Drift,
}

impl Table {
    fn has(self, figures: &Figures) -> bool {
        match self {
            Self::Times => figures.has_times(),
            Self::Drift => figures.has_drift(),
        }
    }
}

/// The papers' rows that stand in a table, in their order and with ours beside them; then those that are ours alone.
pub fn lines(table: Table) -> Vec<Line> {
    let with = |row: &'static Row, figures| Line {
        name: row.name,
        row: Some(row),
        figures,
        peer: row.peer,
    };
    let mut lines = Vec::new();
    for figures in FIGURES.iter().filter(|figures| table.has(figures)) {
        let before = lines.len();
        let same = ROWS.iter().filter(|row| row.paper == Some(figures.row));
        lines.extend(same.map(|row| with(row, Some(figures))));
        if lines.len() == before {
            lines.push(Line {
                name: figures.row,
                row: None,
                figures: Some(figures),
                peer: Some(figures.row),
            });
        }
    }
    let searches = |row: &&Row| table == Table::Times || !row.mask_alone;
    lines.extend(
        ROWS.iter()
            .filter(|row| row.paper.is_none())
            .filter(searches)
            .map(|row| with(row, None)),
    );
    lines
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{collections::BTreeSet, path::Path};

    use super::*;
    use gyre::configuration::Configuration;

    fn row(name: &str) -> &'static Row {
        ROWS.iter().find(|row| row.name == name).unwrap()
    }

    #[test]
    fn the_papers_rows_are_the_papers_configurations() {
        let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
        for (name, file) in [("raw", "mbym.toml"), ("f-raw, line 14", "fast-mbym.toml")] {
            let of_file = Configuration::read(&configs.join(file), &[]).unwrap();
            let mut radiate =
                Configuration::read(&configs.join("radiate.toml"), &row(name).changes()).unwrap();
            radiate.dataset = of_file.dataset;
            assert_eq!(radiate, of_file, "{name}");
        }
    }

    #[test]
    fn masked_rows_are_their_counterparts_with_a_mask() {
        let pairs = [
            ("f-raw, Eq. 7", "f-mbym, Eq. 7"),
            ("raw", "mbym"),
            ("Gyre", "Gyre, masked"),
        ];
        for (plain, masked) in pairs {
            let radiate = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/radiate.toml");
            let with = |changes: Vec<String>| Configuration::read(&radiate, &changes).unwrap();
            let mut found = with(row(masked).changes());
            found.masking.threshold = with(Vec::new()).masking.threshold;
            assert_eq!(found, with(row(plain).changes()), "{masked}");
            assert!(row(plain).mask.is_none() && row(masked).mask.is_some());
        }
        // With a mask the floor is the threshold.
        assert!(
            row("mbym")
                .changes()
                .contains(&"masking.threshold=0".to_owned())
        );
    }

    #[test]
    fn the_rows_with_names_of_their_own_are_those_meant() {
        assert_eq!((PLAIN.name, SHIPPED.name), ("f-raw, line 14", "Gyre"));
        assert!(SHIPPED.changes().is_empty());
    }

    #[test]
    fn every_row_has_a_folder_of_its_own() {
        let folders: BTreeSet<String> = ROWS.iter().map(Row::folder).collect();
        assert_eq!(folders.len(), ROWS.len());
        assert_eq!(row("f-raw, Eq. 7").folder(), "f-raw-eq-7");
    }

    #[test]
    fn lines_follow_the_papers_and_end_with_ours() {
        let names = |table| {
            lines(table)
                .iter()
                .map(|line| (line.name, line.row.is_some()))
                .collect::<Vec<_>>()
        };
        let times = names(Table::Times);
        let common = [
            ("raw", true),
            ("f-raw, line 14", true),
            ("f-raw, Eq. 7", true),
        ];
        assert_eq!(times[0], ("mask", true));
        assert_eq!(times[1..4], common);
        assert_eq!(
            times[4..7],
            [
                ("mbym", true),
                ("f-mbym, Eq. 7", true),
                ("mask, default", true)
            ]
        );
        let drift = names(Table::Drift);
        assert_eq!(drift[..3], common);
        assert_eq!(drift[3], ("mbym (2019)", false));
        assert_eq!(drift.last(), Some(&("Gyre, masked", true)));
        assert!(
            !drift.iter().any(|(name, _)| name.starts_with("mask")),
            "{drift:?}"
        );
    }

    #[test]
    fn papers_figures_are_given_at_their_three_sizes_only() {
        let f_mbym = lines(Table::Times)
            .into_iter()
            .find(|line| line.name == "f-mbym, Eq. 7")
            .unwrap();
        let figures = f_mbym.figures.unwrap();
        assert_eq!(
            (figures.hz(255), figures.drift(255)),
            ([Some(20.6), Some(6.6)], [Some(2.01), Some(6.3)])
        );
        assert_eq!((figures.hz(128), figures.drift(0)), ([None; 2], [None; 2]));
    }
}
