//! The steps from the paper's form to a sequence's own configuration, each with those before it: what each is worth.

use std::path::Path;

use serde::Serialize;

use super::{
    Sequence,
    accuracy::{self, Accuracy},
    rows::{F_RAW, folder},
};
use crate::Failure;

/// Each step, and the `--set` sentences that hold in all steps before it: a step gives them up for the sequence's own.
const STEPS: [(&str, &[&str]); 9] = [
    ("the paper's form", &[]),
    ("Eq. 7", &["rotation.form=line14"]),
    ("range averaged over the cell", &["raster.sampling=bilinear"]),
    ("own raster", &["raster.n=255", "raster.cell_m=0.4"]),
    ("threshold", &["masking.kind=none"]),
    ("compensation", &["masking.compensate=false"]),
    ("own bands, peaks and overlap", F_RAW),
    ("refined against the last keyframe", &["points.capacity=0", "refinement.kind=none"]),
    ("local map", &["refinement.keyframes=1"]),
];

/// The ladder of one sequence.
#[derive(Debug, Serialize)]
pub struct Ladder {
    /// The sequence's configuration.
    pub configuration: String,
    /// The sequence's folder.
    pub data: String,
    /// Step by step.
    pub lines: Vec<Step>,
}

/// A step.
#[derive(Debug, Serialize)]
pub struct Step {
    /// What it adds to those before it.
    pub step: &'static str,
    /// What it came to with them.
    pub accuracy: Accuracy,
}

/// Runs every step on `sequence`, each into a folder of its own below `out`.
pub fn measure(sequence: &Sequence, out: &Path) -> Result<Ladder, Failure> {
    let measured = |(index, (step, _)): (usize, &(&'static str, _))| {
        let out = out.join(folder(&format!("ladder {} {step}", index + 1)));
        Ok(Step { step, accuracy: accuracy::run(sequence, step, &changes(index), &out)? })
    };
    let lines: Result<Vec<_>, Failure> = STEPS.iter().enumerate().map(measured).collect();
    Ok(Ladder {
        configuration: sequence.file.display().to_string(),
        data: sequence.data.display().to_string(),
        lines: lines?,
    })
}

/// What the step at `index` changes in the sequence's own configuration.
fn changes(index: usize) -> Vec<String> {
    STEPS[index + 1..].iter().flat_map(|(_, changes)| *changes).map(|sentence| (*sentence).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{configuration::Configuration, tables::rows::ROWS};

    #[test]
    fn the_ladder_meets_the_rows_of_table_iii_on_its_way() {
        let radiate = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/radiate.toml");
        let with = |changes: Vec<String>| Configuration::read(&radiate, &changes).unwrap();
        let meetings =
            [(0, "f-raw, line 14"), (1, "f-raw, Eq. 7"), (6, "Gyre, search alone"), (7, "Gyre, refined"), (8, "Gyre")];
        for (step, row) in meetings {
            let mut of_row = with(ROWS.iter().find(|of| of.name == row).unwrap().changes());
            let of_step = with(changes(step));
            // Without refinement neither its points nor its keyframes are used.
            if step < 7 {
                of_row.points.capacity = 0;
                of_row.refinement.keyframes = of_step.refinement.keyframes;
            }
            assert_eq!(of_step, of_row, "{row}");
        }
    }
}
