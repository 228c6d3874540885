//! The steps from the paper's form to a sequence's own configuration, each with those before it: what each is worth.

use std::path::Path;

use serde::Serialize;

use super::{
    Sequence,
    accuracy::{self, Accuracy},
    models::{Mask, Model, Models},
    rows::{F_RAW, folder},
};
use gyre::Failure;

/// Each step, and the `--set` sentences that hold in all steps before it: a step gives them up for the sequence's own. Those of
/// earlier steps come first.
const STEPS: [(&str, &[&str]); 10] = [
    ("the paper's form", &[]),
    ("Eq. 7", &["rotation.form=line14"]),
    (
        "range averaged over the cell",
        &["raster.sampling=bilinear"],
    ),
    ("own raster", &["raster.n=255", "raster.cell_m=0.4"]),
    ("threshold", &["masking.kind=none"]),
    (LEARNED_MASK, &["masking.kind=threshold"]),
    ("compensation", &["masking.compensate=false"]),
    ("own bands, peaks and overlap", F_RAW),
    (
        "refined against the last keyframe",
        &["points.capacity=0", "refinement.kind=none"],
    ),
    ("local map", &["refinement.keyframes=1"]),
];

/// The step that is left out where there is no network for the sequence's own raster.
const LEARNED_MASK: &str = "learned mask";

/// The steps in their order.
pub fn steps() -> impl Iterator<Item = &'static str> {
    STEPS.iter().map(|(step, _)| *step)
}

/// The ladder of one sequence.
#[derive(Debug, Serialize)]
pub struct Ladder {
    /// The sequence's configuration.
    pub configuration: String,
    /// The sequence's folder.
    pub data: String,
    /// Step by step.
    pub lines: Vec<Step>,
    /// The network, from the step of the learned mask on.
    pub model: Option<Model>,
    /// Why that step is left out.
    pub left_out: Option<String>,
}

/// A step.
#[derive(Debug, Serialize)]
pub struct Step {
    /// What it adds to those before it.
    pub step: &'static str,
    /// What it came to with them.
    pub accuracy: Accuracy,
}

impl Ladder {
    /// A step by its name, if it was taken.
    pub fn step(&self, name: &str) -> Option<&Step> {
        self.lines.iter().find(|line| line.step == name)
    }
}

/// Runs every step on `sequence`, each into a folder of its own below `out`.
pub fn measure(sequence: &Sequence, models: &Models, out: &Path) -> Result<Ladder, Failure> {
    let raster = sequence.configuration(&[])?.raster;
    let mask = models.find(&Mask::Product, raster.n, Some(raster.cell_m));
    let steps = steps()
        .enumerate()
        .filter(|(_, step)| *step != LEARNED_MASK || mask.is_ok());
    let measured = |(index, step)| {
        let out = out.join(folder(&format!("ladder {} {step}", index + 1)));
        let changes = changes(index, mask.as_ref().ok());
        Ok(Step {
            step,
            accuracy: accuracy::run(sequence, step, &changes, &out)?,
        })
    };
    let lines: Result<Vec<_>, Failure> = steps.map(measured).collect();
    Ok(Ladder {
        configuration: sequence.file.display().to_string(),
        data: sequence.data.display().to_string(),
        lines: lines?,
        model: mask.clone().ok(),
        left_out: mask.err(),
    })
}

/// What the step at `index` changes in the sequence's own configuration, masked by this network if there is one.
fn changes(index: usize, mask: Option<&Model>) -> Vec<String> {
    let learned = mask.filter(|_| {
        STEPS[..=index]
            .iter()
            .any(|(step, _)| *step == LEARNED_MASK)
    });
    let given_up = STEPS[index + 1..]
        .iter()
        .rev()
        .filter(|(step, _)| *step != LEARNED_MASK || mask.is_some());
    let given_up = given_up
        .flat_map(|(_, changes)| *changes)
        .map(|sentence| (*sentence).to_owned());
    learned
        .into_iter()
        .flat_map(Model::changes)
        .chain(given_up)
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_masking::MaskKind;

    use super::*;
    use crate::tables::rows::ROWS;
    use gyre::configuration::Configuration;

    #[test]
    fn the_ladder_meets_the_rows_of_table_iii_on_its_way() {
        let radiate = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/radiate.toml");
        let with = |changes: Vec<String>| Configuration::read(&radiate, &changes).unwrap();
        let meetings = [
            (0, "f-raw, line 14"),
            (1, "f-raw, Eq. 7"),
            (7, "Gyre, search alone"),
            (8, "Gyre, refined"),
            (9, "Gyre"),
        ];
        for (step, row) in meetings {
            let mut of_row = with(ROWS.iter().find(|of| of.name == row).unwrap().changes());
            let of_step = with(changes(step, None));
            // Without refinement neither its points nor its keyframes are used.
            if step < 8 {
                of_row.points.capacity = 0;
                of_row.refinement.keyframes = of_step.refinement.keyframes;
            }
            assert_eq!(of_step, of_row, "{row}");
        }
        let model = Model {
            card: "models/gyre-255.toml".into(),
            cell_m: 0.8,
            instead_of: None,
        };
        let masked = ROWS.iter().find(|of| of.name == "Gyre, masked").unwrap();
        assert_eq!(
            with(changes(9, Some(&model))),
            with(masked.changes_with(Some(&model)))
        );
    }

    #[test]
    fn all_steps_up_to_the_learned_mask_are_as_without_it() {
        let model = Model {
            card: "models/gyre-255.toml".into(),
            cell_m: 0.8,
            instead_of: None,
        };
        // Also where the sequence's own configuration has a learned mask.
        for own in [Vec::new(), Model::changes(&model).to_vec()] {
            let kind = |step: usize| {
                let changes = own.iter().cloned().chain(changes(step, Some(&model)));
                Configuration::of_overrides(&changes.collect::<Vec<_>>())
                    .unwrap()
                    .masking
                    .kind
            };
            let kinds: Vec<MaskKind> = (0..STEPS.len()).map(kind).collect();
            assert_eq!(kinds[..4], [MaskKind::None; 4]);
            assert_eq!(kinds[4], MaskKind::Threshold);
            assert_eq!(kinds[5..], [MaskKind::Learned; 5]);
        }
    }
}
