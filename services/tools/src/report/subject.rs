//! A run or a trajectory that a page is about.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::{Failure, print};
use gyre_datasets::read_trajectory;
use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use gyre_results::{SUMMARY, evaluation::Evaluation, judgement::judge, require_results};
use serde_json::{Value, json};

pub struct Subject {
    pub name: String,
    /// The errors, where there is a ground truth that fits.
    pub evaluation: Option<Evaluation>,
    pub trajectory: Trajectory,
    /// The figures, as `summary.json` has them; the errors are those against the common ground
    /// truth.
    pub figures: Value,
    pub run: Option<Run>,
}

pub struct Run {
    pub folder: PathBuf,
    pub summary: Value,
    pub configuration: String,
}

impl Subject {
    pub fn read(path: &Path, truth: Option<&Trajectory>) -> Result<Self, Failure> {
        let run = path.is_dir().then(|| Run::read(path)).transpose()?;
        let file = match &run {
            Some(run) => run.folder.join("trajectory.tum"),
            None => path.to_owned(),
        };
        let trajectory = read_trajectory(&file)?;
        let evaluation = truth.and_then(|truth| {
            judge(&trajectory, truth)
                .inspect_err(|reason| {
                    print::note(format_args!(
                        "{} is not evaluated: {reason}",
                        file.display()
                    ))
                })
                .ok()
        });
        let duration_s = |(first_ns, last_ns): (i64, i64)| (last_ns - first_ns) as f64 * 1e-9;
        let summary = run.as_ref().map(|run| run.summary.clone());
        let summary = summary.filter(Value::is_object);
        let mut figures = summary.unwrap_or_else(|| json!({}));
        figures["path_m"] = json!(trajectory.path_length_m());
        figures["duration_s"] = json!(trajectory.span_ns().map(duration_s));
        figures["processed"] = json!(trajectory.poses.len());
        figures["evaluation"] = serde_json::to_value(&evaluation)?;
        Ok(Self {
            name: path.display().to_string(),
            evaluation,
            trajectory,
            figures,
            run,
        })
    }

    /// Returns the poses to draw: in the frame of the ground truth, or as they are.
    pub fn drawn(&self) -> Vec<Pose> {
        match &self.evaluation {
            Some(evaluation) => {
                let aligned = evaluation.ate.truth_from_estimate;
                let poses = evaluation.matched.estimate().iter();
                poses.map(|pose| aligned * pose).collect()
            }
            None => self.trajectory.poses.clone(),
        }
    }
}

impl Run {
    fn read(folder: &Path) -> Result<Self, Failure> {
        require_results(folder)?;
        let text = |name: &str| {
            let path = folder.join(name);
            fs::read_to_string(&path).map_err(|error| {
                let (folder, path) = (folder.display(), path.display());
                format!("{folder} has no complete results of a run: cannot read {path}: {error}")
            })
        };
        Ok(Self {
            folder: folder.to_owned(),
            summary: serde_json::from_str(&text(SUMMARY)?)?,
            configuration: text("config.toml")?,
        })
    }

    pub fn number(&self, path: &str) -> Option<f64> {
        self.summary.pointer(path)?.as_f64()
    }

    pub fn picture(&self, name: &str) -> Option<Vec<u8>> {
        fs::read(self.folder.join(name)).ok()
    }
}
