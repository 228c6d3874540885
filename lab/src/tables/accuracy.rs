//! Table IIIb: how accurate each row is on a sequence, by running the pipeline on it.

use std::{
    env, fs,
    path::Path,
    process::{Command, Stdio},
};

use gyre_messages::Stage;
use serde::Serialize;
use serde_json::Value;

use super::{
    Sequence, command,
    models::{Model, Models, Note, note},
    rows::{Line, Row, Table, lines},
};
use gyre::{Failure, print};

/// The table of one sequence.
#[derive(Debug, Serialize)]
pub struct Accuracies {
    /// The sequence's configuration.
    pub configuration: String,
    /// The sequence's folder.
    pub data: String,
    /// Row by row.
    pub lines: Vec<AccuracyLine>,
    /// Why rows are left out.
    pub left_out: Vec<Note>,
}

/// A row.
#[derive(Debug, Serialize)]
pub struct AccuracyLine {
    /// The row.
    pub row: &'static str,
    /// The network that masked.
    pub model: Option<Model>,
    /// What it came to here; `None` where this program has no such row, or not the network for it.
    pub ours: Option<Accuracy>,
    /// The paper's KITTI errors at this raster's size, on other sequences: %, and degrees per km.
    pub paper: [Option<f64>; 2],
}

/// What a run came to. A figure is `None` without a ground truth that fits, or where the truth allows none: see
/// `gyre evaluate`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// The command that repeats it.
    pub command: String,
    /// Cells a side.
    pub n: usize,
    /// Length of the truth, m.
    pub path_m: Option<f64>,
    /// KITTI translation error, %.
    pub translation_percent: Option<f64>,
    /// KITTI rotation error, degrees per 100 m.
    pub rotation_deg_per_100m: Option<f64>,
    /// The same per km.
    pub rotation_deg_per_km: Option<f64>,
    /// Absolute trajectory error, m.
    pub ate_m: Option<f64>,
    /// Segment error, %.
    pub seg_percent: Option<f64>,
    /// Rotation error of single motions (root of the mean square), degrees.
    pub pair_rotation_deg: Option<f64>,
    /// Estimated over true distance driven forward.
    pub forward_ratio: Option<f64>,
    /// Work of masking for a scan: median, ms.
    pub masking_ms: f64,
    /// Work of the stages between masking and the pose for a scan: the sum of their medians, ms.
    pub search_ms: f64,
    /// Of the whole pipeline.
    pub scans_per_s: Option<f64>,
}

/// Runs every row on `sequence`, each into a folder of its own below `out`.
pub fn measure(sequence: &Sequence, models: &Models, out: &Path) -> Result<Accuracies, Failure> {
    let (mut measured, mut left_out) = (Vec::new(), Vec::new());
    for line in lines(Table::Drift) {
        let (row, model) = match line
            .row
            .map(|row| model(sequence, row, models))
            .transpose()?
            .unwrap_or(Ok(None))
        {
            Ok(model) => (line.row, model),
            Err(reason) => {
                note(&mut left_out, reason, line.name.to_owned());
                (None, None)
            }
        };
        if row.is_some() || line.figures.is_some() {
            measured.push(measure_line(sequence, &line, row, model, out)?);
        }
    }
    Ok(Accuracies {
        configuration: sequence.file.display().to_string(),
        data: sequence.data.display().to_string(),
        lines: measured,
        left_out,
    })
}

/// The network of a row, if it has one; else why it cannot be used.
fn model(
    sequence: &Sequence,
    row: &Row,
    models: &Models,
) -> Result<Result<Option<Model>, String>, Failure> {
    let raster = sequence.configuration(&row.changes())?.raster;
    Ok(row
        .mask
        .as_ref()
        .map(|mask| models.find(mask, raster.n, Some(raster.cell_m)))
        .transpose())
}

fn measure_line(
    sequence: &Sequence,
    line: &Line,
    row: Option<&Row>,
    model: Option<Model>,
    out: &Path,
) -> Result<AccuracyLine, Failure> {
    let run = |row: &Row| {
        run(
            sequence,
            row.name,
            &row.changes_with(model.as_ref()),
            &out.join(row.folder()),
        )
    };
    let ours = row.map(run).transpose()?;
    let n = match &ours {
        Some(ours) => ours.n,
        None => sequence.configuration(&[])?.raster.n,
    };
    let paper = line.figures.map_or([None; 2], |figures| figures.drift(n));
    Ok(AccuracyLine {
        row: line.name,
        model,
        ours,
        paper,
    })
}

/// Runs a sequence with changes as a person would, by `gyre run`, and reads what it left.
pub(crate) fn run(
    sequence: &Sequence,
    name: &str,
    changes: &[String],
    out: &Path,
) -> Result<Accuracy, Failure> {
    let n = sequence.configuration(changes)?.raster.n;
    let arguments = sequence.run_arguments(changes, out);
    print::note(format_args!("{}: {name}", sequence.name));
    let status = Command::new(env::current_exe()?)
        .args(&arguments)
        .stdout(Stdio::null())
        .status()
        .map_err(|error| format!("cannot start gyre run: {error}"))?;
    if !status.success() {
        return Err(format!("`{}` did not succeed", command(&arguments)).into());
    }
    let summary = out.join("summary.json");
    let text = fs::read_to_string(&summary)
        .map_err(|error| format!("cannot read {}: {error}", summary.display()))?;
    Ok(Accuracy::new(
        command(&arguments),
        n,
        &serde_json::from_str(&text)?,
    ))
}

impl Accuracy {
    /// From `summary.json`.
    fn new(command: String, n: usize, summary: &Value) -> Self {
        let figure = |path: &str| summary.pointer(path).and_then(Value::as_f64);
        let work_ms = |stage: Stage| {
            let median_us = figure(&["/latency/stages", stage.name(), "work", "p50_us"].join("/"));
            median_us.unwrap_or(0.0) * 1e-3
        };
        let around = [Stage::RadarReplay, Stage::Masking, Stage::PoseIntegration];
        let search = Stage::ALL
            .into_iter()
            .filter(|stage| !around.contains(stage));
        Self {
            command,
            n,
            path_m: figure("/evaluation/path_m"),
            translation_percent: figure("/evaluation/kitti/translation_percent"),
            rotation_deg_per_100m: figure("/evaluation/kitti/rotation_deg_per_100m"),
            rotation_deg_per_km: figure("/evaluation/kitti/rotation_deg_per_km"),
            ate_m: figure("/evaluation/ate/rmse_m"),
            seg_percent: figure("/evaluation/seg/percent"),
            pair_rotation_deg: figure("/evaluation/rpe/rotation_rmse_deg"),
            forward_ratio: figure("/evaluation/rpe/forward_ratio"),
            masking_ms: work_ms(Stage::Masking),
            search_ms: search.map(work_ms).sum(),
            scans_per_s: figure("/scans_per_s"),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_summary_gives_errors_and_the_time_of_all_stages_between_masking_and_pose() {
        let work = |p50_us: f64| json!({ "work": { "p50_us": p50_us, "p90_us": 1e6 } });
        let stages = json!({
            "radar-replay": work(9000.0), "masking": work(2000.0), "rotation-search": work(250.0),
            "translation-search": work(500.0), "refinement": work(1500.0), "pose-integration": work(7.0)
        });
        let rpe = json!({ "rotation_rmse_deg": 0.25, "forward_ratio": null });
        let evaluation = json!({ "path_m": 22.0, "kitti": null, "ate": { "rmse_m": 0.5 }, "seg": null, "rpe": rpe });
        let summary = json!({ "scans_per_s": 120.5, "latency": { "stages": stages }, "evaluation": evaluation });
        let accuracy = Accuracy::new("x".to_owned(), 255, &summary);
        assert_eq!(
            (
                accuracy.masking_ms,
                accuracy.search_ms,
                accuracy.scans_per_s
            ),
            (2.0, 2.25, Some(120.5))
        );
        assert_eq!(
            (accuracy.path_m, accuracy.ate_m, accuracy.pair_rotation_deg),
            (Some(22.0), Some(0.5), Some(0.25))
        );
        assert_eq!(
            (
                accuracy.translation_percent,
                accuracy.seg_percent,
                accuracy.forward_ratio
            ),
            (None, None, None)
        );
    }
}
