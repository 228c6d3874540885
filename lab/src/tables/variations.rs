//! What a single change does to the shipped configuration: whether a choice holds among its neighbours, and what each
//! ingredient gives.

use std::path::Path;

use serde::Serialize;

use super::{
    Sequence,
    accuracy::{self, Accuracy},
};
use gyre::Failure;

/// The table of one sequence.
#[derive(Debug, Serialize)]
pub struct Variations {
    /// The sequence's folder.
    pub data: String,
    /// The configuration as it is, then each change alone.
    pub lines: Vec<Variation>,
    /// Medians over the changes.
    pub median: Medians,
}

/// One change.
#[derive(Debug, Serialize)]
pub struct Variation {
    /// The change, `section.key=value`; empty for none.
    pub change: String,
    /// What it came to.
    pub accuracy: Accuracy,
}

/// `None` where the truth allows no such figure.
#[derive(Debug, Serialize)]
pub struct Medians {
    /// KITTI translation error, %.
    pub translation_percent: Option<f64>,
    /// KITTI rotation error, degrees per 100 m.
    pub rotation_deg_per_100m: Option<f64>,
    /// Absolute trajectory error, m.
    pub ate_m: Option<f64>,
    /// Segment error, %.
    pub seg_percent: Option<f64>,
}

/// `section.key=a,b` as `section.key=a` and `section.key=b`.
pub fn changes(sentences: &[String]) -> Result<Vec<String>, Failure> {
    let mut changes = Vec::new();
    for sentence in sentences {
        let (key, values) = sentence.split_once('=').ok_or_else(|| {
            format!(
                "--vary {sentence}: expected section.key=value,value, as in masking.threshold=50,70"
            )
        })?;
        changes.extend(values.split(',').map(|value| format!("{key}={value}")));
    }
    Ok(changes)
}

/// Runs the sequence once as it is and once with each change, each into a folder of its own below `out`.
pub fn measure(sequence: &Sequence, changes: &[String], out: &Path) -> Result<Variations, Failure> {
    let run = |change: &str, changes: &[String]| -> Result<Variation, Failure> {
        let name = if change.is_empty() {
            "as it is"
        } else {
            change
        };
        let accuracy = accuracy::run(
            sequence,
            name,
            changes,
            &out.join(name.replace(['/', ' '], "-")),
        )?;
        Ok(Variation {
            change: change.to_owned(),
            accuracy,
        })
    };
    let mut lines = vec![run("", &[])?];
    for change in changes {
        lines.push(run(change, std::slice::from_ref(change))?);
    }
    let median = |figure: fn(&Accuracy) -> Option<f64>| {
        median(lines[1..].iter().filter_map(|line| figure(&line.accuracy)))
    };
    let median = Medians {
        translation_percent: median(|accuracy| accuracy.translation_percent),
        rotation_deg_per_100m: median(|accuracy| accuracy.rotation_deg_per_100m),
        ate_m: median(|accuracy| accuracy.ate_m),
        seg_percent: median(|accuracy| accuracy.seg_percent),
    };
    Ok(Variations {
        data: sequence.data.display().to_string(),
        lines,
        median,
    })
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    Some(if values.len() % 2 == 1 {
        upper
    } else {
        0.5 * (values[values.len() / 2 - 1] + upper)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_list_of_values_is_a_change_each() {
        let sentences = ["masking.threshold=50,70", "search.kind=exhaustive"].map(str::to_owned);
        let expected = [
            "masking.threshold=50",
            "masking.threshold=70",
            "search.kind=exhaustive",
        ];
        assert_eq!(changes(&sentences).unwrap(), expected);
        assert!(changes(&["masking.threshold".to_owned()]).is_err());
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), Some(2.0));
        assert_eq!(median([4.0, 1.0, 2.0, 3.0].into_iter()), Some(2.5));
        assert_eq!(median([].into_iter()), None);
    }
}
