//! `gyre report`: one page about a run, or about several runs and the trajectories of other
//! programs beside each other. The page has all its pictures in it and needs no network.

mod page;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use clap::Args;
use gyre_configuration::terminal::{Failure, print};
use gyre_datasets::read_trajectory;
use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use gyre_results::{
    SUMMARY, evaluate::truth_of_run, evaluation::Evaluation, judgement::judge, require_results,
    write_page,
};
use serde_json::{Value, json};

use page::page;

#[derive(Debug, Args)]
pub struct ReportArguments {
    /// Runs, by the folders of their results, and trajectories of other programs (TUM, KITTI or a
    /// dataset's own format). Of several the page compares them.
    #[arg(required = true, value_name = "RUN|FILE")]
    pub subjects: Vec<PathBuf>,
    /// The ground truth of all. Default: that of the first run that has one.
    #[arg(long, value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// The page to write: a new file, a page of gyre report, a FIFO or a device. Default:
    /// report.html in the folder of a run, of several comparison.html in that of the first.
    #[arg(long, value_name = "FILE")]
    pub to: Option<PathBuf>,
    /// Open the page in the browser.
    #[arg(long)]
    pub open: bool,
}

pub fn report(arguments: &ReportArguments) -> Result<(), Failure> {
    let truth = match &arguments.ground_truth {
        Some(truth) => Some(truth.clone()),
        None => truth_of(&arguments.subjects),
    };
    let truth = truth.as_deref().map(read_trajectory).transpose()?;
    let read = |path: &PathBuf| Subject::read(path, truth.as_ref());
    let subjects = with_corrected(&arguments.subjects);
    let subjects: Result<Vec<Subject>, Failure> = subjects.iter().map(read).collect();
    let default = || default_page(&arguments.subjects);
    let to = arguments.to.clone().unwrap_or_else(default);
    write_page(&to, &page(&subjects?)?, "<p>by gyre report, ")?;
    print::line(to.display())?;
    match arguments.open {
        true => open(&to),
        false => Ok(()),
    }
}

/// Returns the runs and trajectories, each run with the trajectory that its loops have corrected.
fn with_corrected(subjects: &[PathBuf]) -> Vec<PathBuf> {
    let both = |path: &PathBuf| {
        let corrected = path.join("trajectory_slam.tum");
        [Some(path.clone()), corrected.is_file().then_some(corrected)]
    };
    subjects.iter().flat_map(both).flatten().collect()
}

fn truth_of(subjects: &[PathBuf]) -> Option<PathBuf> {
    let runs = subjects.iter().filter(|path| path.is_dir());
    let mut truths = runs.filter_map(|run| truth_of_run(run).ok());
    truths.find(|truth| truth.is_file())
}

fn default_page(subjects: &[PathBuf]) -> PathBuf {
    let name = match subjects {
        [_] => "report.html",
        _ => "comparison.html",
    };
    let first = subjects.first().filter(|path| path.is_dir());
    first.map_or_else(|| name.into(), |run| run.join(name))
}

fn open(page: &Path) -> Result<(), Failure> {
    let mut command = Command::new("xdg-open");
    command
        .arg(page)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let reason = match command.status() {
        Ok(status) if status.success() => return Ok(()),
        Ok(status) => status.to_string(),
        Err(error) => error.to_string(),
    };
    let page = page.display();
    Err(format!("cannot open a browser by xdg-open ({reason}): open {page} yourself").into())
}

/// A run or a trajectory that a page is about.
struct Subject {
    name: String,
    /// The errors, where there is a ground truth that fits.
    evaluation: Option<Evaluation>,
    trajectory: Trajectory,
    /// The figures, as `summary.json` has them; the errors are those against the common ground
    /// truth.
    figures: Value,
    run: Option<Run>,
}

struct Run {
    folder: PathBuf,
    summary: Value,
    configuration: String,
}

impl Subject {
    fn read(path: &Path, truth: Option<&Trajectory>) -> Result<Self, Failure> {
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
    fn drawn(&self) -> Vec<Pose> {
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

    fn number(&self, path: &str) -> Option<f64> {
        self.summary.pointer(path)?.as_f64()
    }

    fn picture(&self, name: &str) -> Option<Vec<u8>> {
        fs::read(self.folder.join(name)).ok()
    }
}
