//! `gyre-lab ablation`: measures the contribution of each step from the paper's form to a sequence's own configuration, or the effect of
//! single changes of that configuration.

use std::{collections::BTreeSet, path::Path, process::ExitCode};

use gyre::Failure;
use gyre_radar::median;
use serde::{Deserialize, Serialize};

use crate::{
    cli::AblationArguments,
    models::Model,
    report::{Heading, Notes, make_folder, publish},
    sequence::{Experiment, Figures, LEGEND, Line, Sequence},
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

/// `ablation.json`.
#[derive(Debug, Serialize)]
struct Ablation {
    #[serde(flatten)]
    heading: Heading,
    /// Sequence by sequence.
    experiments: Vec<Experiment>,
}

/// Runs all steps, or all changes, on every sequence; prints and writes what they came to.
///
/// # Errors
/// A recording, run or file that fails.
pub fn ablation(arguments: &AblationArguments) -> Result<ExitCode, Failure> {
    let sequences = Sequence::all(&arguments.sequences)?;
    let changes = changes(&arguments.vary)?;
    for change in &changes {
        sequences[0].configuration(std::slice::from_ref(change))?;
    }
    make_folder(&arguments.out)?;
    let measure = |sequence: &Sequence| match changes.is_empty() {
        true => steps(sequence, &arguments.sequences.models, &arguments.out),
        false => variations(sequence, &changes, &arguments.out),
    };
    let ablation = Ablation {
        heading: Heading::now(),
        experiments: sequences.iter().map(measure).collect::<Result<_, _>>()?,
    };
    let tables: String = ablation
        .experiments
        .iter()
        .map(Experiment::markdown)
        .collect();
    let text = ablation.heading.markdown("Ablation") + &tables + LEGEND;
    publish(&arguments.out, "ablation", &ablation, &text)?;
    Ok(ExitCode::SUCCESS)
}

/// Runs every step on `sequence`, each on top of those before it.
fn steps(sequence: &Sequence, models: &Path, out: &Path) -> Result<Experiment, Failure> {
    let (mut steps, mut left_out) = (toml::from_str::<Steps>(STEPS)?.step, Notes::new());
    let mut model = None;
    if let Some(masked) = steps.iter().position(|step| step.mask.is_some()) {
        let names: Vec<String> = steps[masked].mask.iter().cloned().collect();
        match sequence.model(models, &names, &[])? {
            Ok(found) => model = Some(found),
            Err(reason) => {
                left_out.insert(reason, vec![steps.remove(masked).name]);
            }
        }
    }
    let run = |index: usize| {
        let changes = changes_of(&steps, index, model.as_ref());
        let (_, line) = sequence.run(
            &format!("{} {}", index + 1, steps[index].name),
            &changes,
            out,
        )?;
        let masked = steps[..=index].iter().any(|step| step.mask.is_some());
        Ok(Line {
            model: model.clone().filter(|_| masked),
            ..line
        })
    };
    Ok(Experiment {
        title: "Each step on top of those before it",
        data: sequence.data.display().to_string(),
        lines: (0..steps.len()).map(run).collect::<Result<_, Failure>>()?,
        left_out,
    })
}

/// Returns the overrides of the step at `index`: those of the mask, then those that later steps remove, the latest first.
fn changes_of(steps: &[Step], index: usize, model: Option<&Model>) -> Vec<String> {
    let masked = steps[..=index].iter().any(|step| step.mask.is_some());
    let learned = model
        .filter(|_| masked)
        .into_iter()
        .flat_map(Model::changes);
    let held = steps[index + 1..]
        .iter()
        .rev()
        .flat_map(|step| step.until.clone());
    learned.chain(held).collect()
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

/// Runs the sequence once as it is and once with each change alone; the last line has the medians over the changes.
fn variations(sequence: &Sequence, changes: &[String], out: &Path) -> Result<Experiment, Failure> {
    let mut lines = vec![sequence.run("as it is", &[], out)?.1];
    for change in changes {
        lines.push(sequence.run(change, std::slice::from_ref(change), out)?.1);
    }
    let of_changes = lines[1..].iter().map(|line| &line.figures);
    let medians = Line {
        row: "median of the changes".to_owned(),
        figures: medians(&of_changes.collect::<Vec<_>>()),
        ..Line::default()
    };
    lines.push(medians);
    Ok(Experiment {
        title: "One change at a time",
        data: sequence.data.display().to_string(),
        lines,
        left_out: Notes::new(),
    })
}

fn medians(runs: &[&Figures]) -> Figures {
    let keys: BTreeSet<&str> = runs
        .iter()
        .flat_map(|figures| figures.keys().copied())
        .collect();
    let median = |key| median(runs.iter().filter_map(|figures| figures.get(key).copied()));
    keys.into_iter()
        .filter_map(|key| Some((key, median(key)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre::configuration::Configuration;
    use gyre_masking::MaskKind;

    use super::*;
    use crate::tables::rows::Rows;

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
        let radiate = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/radiate.toml");
        let with = |changes: Vec<String>| Configuration::read(&radiate, &changes).unwrap();
        let (rows, all) = (Rows::read().unwrap(), all_steps());
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
            let mut of_row = with(rows.named(row).unwrap().changes(&rows, None));
            let of_step = with(changes_of(&unmasked, step, None));
            // Without refinement neither its points nor its keyframes are used.
            if step < 7 {
                of_row.odometry.points.capacity = 0;
                of_row.odometry.refinement.keyframes = of_step.odometry.refinement.keyframes;
            }
            assert_eq!(of_step, of_row, "{row}");
        }
        let masked = rows
            .named("Gyre, masked")
            .unwrap()
            .changes(&rows, Some(&product()));
        assert_eq!(with(changes_of(&all, 9, Some(&product()))), with(masked));
    }

    #[test]
    fn the_learned_mask_holds_from_its_step_on() {
        // Also where the sequence's own configuration has a learned mask.
        for own in [Vec::new(), product().changes().to_vec()] {
            let kind = |step: usize| {
                let changes = changes_of(&all_steps(), step, Some(&product()));
                let changes: Vec<String> = own.iter().cloned().chain(changes).collect();
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

    #[test]
    fn medians_are_taken_figure_by_figure() {
        let [a, b] = [
            Figures::from([("ate_m", 1.0)]),
            Figures::from([("ate_m", 3.0), ("path_m", 7.0)]),
        ];
        assert_eq!(
            medians(&[&a, &b]),
            Figures::from([("ate_m", 3.0), ("path_m", 7.0)])
        );
    }
}
