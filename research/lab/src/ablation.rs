//! `gyre-lab ablation`: measures the contribution of each step from the paper's form to a
//! sequence's own configuration, or the effect of single changes of that configuration.

use std::{path::Path, process::ExitCode, slice};

use gyre_configuration::terminal::Failure;
use serde::Deserialize;

use crate::{
    cli::AblationArguments,
    report::{Notes, Table, make_folder, publish},
    sequence::Sequence,
};

/// The steps in their order.
const STEPS: &str = include_str!("../rows/ablation.toml");

#[derive(Debug, Deserialize)]
struct Steps {
    step: Vec<Step>,
}

/// A step from the paper's form to a sequence's own configuration.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    name: String,
    /// Overrides that hold in all steps before this one.
    #[serde(default)]
    until: Vec<String>,
    /// The network that masks from this step on.
    mask: Option<String>,
}

/// Runs all steps, or all changes, on every sequence; prints and writes the results.
pub fn ablation(arguments: &AblationArguments) -> Result<ExitCode, Failure> {
    let sequences = Sequence::all(&arguments.sequences)?;
    let changes = changes(&arguments.vary)?;
    for change in &changes {
        sequences[0].configuration(slice::from_ref(change))?;
    }
    make_folder(&arguments.out)?;
    let measure = |sequence: &Sequence| match changes.is_empty() {
        true => steps(sequence, &arguments.sequences.models, &arguments.out),
        false => variations(sequence, &changes, &arguments.out),
    };
    let tables = sequences
        .iter()
        .map(measure)
        .collect::<Result<Vec<_>, _>>()?;
    publish("ablation", &tables, &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

/// Runs every step on `sequence`, each on top of those before it.
fn steps(sequence: &Sequence, models: &Path, out: &Path) -> Result<Table, Failure> {
    let (mut steps, mut left_out) = (toml::from_str::<Steps>(STEPS)?.step, Notes::new());
    let names: Vec<String> = steps.iter().filter_map(|step| step.mask.clone()).collect();
    let model = match sequence.model(models, &names, &[])? {
        Ok(model) => model,
        Err(reason) => {
            let masked = steps.extract_if(.., |step| step.mask.is_some());
            left_out.insert(reason, masked.map(|step| step.name).collect());
            None
        }
    };
    let run = |index: usize| {
        let name = format!("{} {}", index + 1, steps[index].name);
        let model = model.as_ref().filter(|_| is_masked(&steps, index));
        Ok(sequence
            .run(&name, &changes_of(&steps, index), model, out)?
            .1)
    };
    let records = (0..steps.len()).map(run).collect::<Result<_, Failure>>()?;
    Ok(sequence.table("Each step on top of those before it", records, left_out))
}

fn is_masked(steps: &[Step], index: usize) -> bool {
    steps[..=index].iter().any(|step| step.mask.is_some())
}

/// Returns the overrides of the step at `index`: those that later steps remove, the latest first.
fn changes_of(steps: &[Step], index: usize) -> Vec<String> {
    let later = steps[index + 1..].iter().rev();
    later.flat_map(|step| step.until.clone()).collect()
}

/// `section.key=a,b` as `section.key=a` and `section.key=b`.
fn changes(sentences: &[String]) -> Result<Vec<String>, Failure> {
    let mut changes = Vec::new();
    for sentence in sentences {
        let expected = "expected section.key=value,value, as in masking.threshold=50,70";
        let split = sentence.split_once('=');
        let (key, values) = split.ok_or_else(|| format!("--vary {sentence}: {expected}"))?;
        changes.extend(values.split(',').map(|value| format!("{key}={value}")));
    }
    Ok(changes)
}

/// Runs the sequence once as it is and once with each change alone.
fn variations(sequence: &Sequence, changes: &[String], out: &Path) -> Result<Table, Failure> {
    let mut records = vec![sequence.run("as it is", &[], None, out)?.1];
    for change in changes {
        let run = sequence.run(change, slice::from_ref(change), None, out)?;
        records.push(run.1);
    }
    Ok(sequence.table("One change at a time", records, Notes::new()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_configuration::Configuration;
    use gyre_masking::MaskKind;

    use super::*;
    use crate::{models::Model, tables::rows::PaperTables};

    fn all_steps() -> Vec<Step> {
        toml::from_str::<Steps>(STEPS).unwrap().step
    }

    fn product() -> Model {
        Model {
            card: "models/gyre-255.toml".into(),
            cell_m: 0.8,
        }
    }

    #[test]
    fn the_steps_meet_the_rows_of_table_iii_on_their_way() {
        let radiate = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/radiate.toml");
        let with = |changes: Vec<String>| Configuration::read(&radiate, &changes).unwrap();
        let (rows, all) = (PaperTables::read().unwrap(), all_steps());
        let unmasked: Vec<Step> = all
            .iter()
            .filter(|step| step.mask.is_none())
            .cloned()
            .collect();
        let meetings = [
            (0, "f-raw, line 14"),
            (1, "f-raw, Eq. 7"),
            (6, "Gyre, search alone"),
            (7, "Gyre, refined"),
            (8, "Gyre"),
        ];
        for (step, row) in meetings {
            let mut of_row = with(rows.named(row).unwrap().changes(&rows));
            let of_step = with(changes_of(&unmasked, step));
            // Without refinement neither its points nor its keyframes are used.
            if step < 7 {
                of_row.odometry.points.capacity = 0;
                of_row.odometry.refinement.keyframes = of_step.odometry.refinement.keyframes;
            }
            assert_eq!(of_step, of_row, "{row}");
        }
        let masked = rows.named("Gyre, masked").unwrap();
        assert!(is_masked(&all, 9) && !masked.mask.is_empty());
        assert_eq!(with(changes_of(&all, 9)), with(masked.changes(&rows)));
    }

    #[test]
    fn the_learned_mask_holds_from_its_step_on() {
        // Also where the sequence's own configuration has a learned mask.
        for own in [Vec::new(), product().changes().to_vec()] {
            let kind = |step: usize| {
                let mut changes = own.clone();
                changes.extend(changes_of(&all_steps(), step));
                if is_masked(&all_steps(), step) {
                    changes.extend(product().changes());
                }
                Configuration::of_overrides(&changes)
                    .unwrap()
                    .odometry
                    .masking
                    .kind
            };
            let kinds: Vec<MaskKind> = (0..10).map(kind).collect();
            assert_eq!(kinds[..4], [MaskKind::None; 4]);
            assert_eq!(kinds[4], MaskKind::Threshold);
            assert_eq!(kinds[5..], [MaskKind::Learned; 5]);
        }
    }

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
}
