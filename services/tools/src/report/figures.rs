//! The figures of runs and trajectories, as rows of a table.

use gyre_results::figures::{Figure, GROUPS};

use crate::report::subject::Subject;

/// A row: a name, and a value for each subject.
pub struct Row {
    /// The name, with the unit.
    pub name: &'static str,
    /// The values as text; `None`: it has none.
    pub values: Vec<Option<String>>,
    /// Of errors, the place of the smallest, where there are several.
    pub best: Option<usize>,
}

/// Rows under a title.
pub struct Group {
    pub title: &'static str,
    pub rows: Vec<Row>,
}

pub fn groups(subjects: &[Subject]) -> Vec<Group> {
    let groups = GROUPS.iter().map(|(title, figures)| {
        let rows = figures.iter().map(|figure| row(figure, subjects));
        let rows = rows.filter(|row| row.values.iter().any(Option::is_some));
        let rows = rows.collect();
        Group { title, rows }
    });
    groups.filter(|group| !group.rows.is_empty()).collect()
}

fn row(figure: &Figure, subjects: &[Subject]) -> Row {
    let values = subjects.iter().map(|it| figure.text(&it.figures));
    let errors = subjects.iter().enumerate();
    let errors = errors.filter_map(|(place, it)| Some((place, figure.error(&it.figures)?)));
    let best = errors.min_by(|(_, one), (_, other)| one.total_cmp(other));
    Row {
        name: figure.name,
        values: values.collect(),
        best: best.map(|(place, _)| place).filter(|_| subjects.len() > 1),
    }
}
