//! `gyre report`: one page about a run, or about several runs and the trajectories of other
//! programs beside each other. The page has all its pictures in it and needs no network.

mod page;
mod subject;

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use clap::Args;
use gyre_configuration::terminal::{Failure, print};
use gyre_datasets::read_trajectory;
use gyre_results::{evaluate::truth_of_run, write_page};

use page::page;
use subject::Subject;

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
