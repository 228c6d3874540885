//! What the searches reach on a recording, by running the pipeline on it.

use gyre_evaluation::Options;
use gyre_radar::{
    Trajectory,
    ground_truth::{find_ground_truth, read_trajectory},
};
use gyre_realism::SearchErrors;

use super::recording::Source;
use crate::{
    Failure,
    judgement::judge,
    print,
    tables::{
        accuracy,
        rows::{PLAIN, Row, SHIPPED},
    },
};

/// How a recording moves, and how well that is found out from its scans.
#[derive(Debug, Default)]
pub struct Searches {
    /// Ground truth with times and headings.
    pub truth: Option<Trajectory>,
    /// What the shipped configuration makes of the scans.
    pub odometry: Option<Trajectory>,
    /// Errors of the search in the paper's form; `None` without truth.
    pub plain: Option<SearchErrors>,
    /// Errors of the shipped configuration; `None` without truth.
    pub refined: Option<SearchErrors>,
}

impl Searches {
    /// Runs both on the recording's first `scans` scans, or neither if there are no two.
    pub fn run(source: &Source, scans: usize) -> Result<Self, Failure> {
        let truth = truth(source);
        if source.scans().min(scans) < 2 {
            return Ok(Self { truth, ..Self::default() });
        }
        let plain = run(source, PLAIN, scans)?;
        let refined = run(source, SHIPPED, scans)?;
        let errors = |odometry: &Trajectory| errors(odometry, truth.as_ref()?, source);
        Ok(Self { plain: errors(&plain), refined: errors(&refined), odometry: Some(refined), truth })
    }
}

fn truth(source: &Source) -> Option<Trajectory> {
    let path = find_ground_truth(&source.data)?;
    let truth = read_trajectory(&path);
    let truth = truth.inspect_err(|error| print::note(format_args!("not compared with the truth: {error}"))).ok()?;
    (truth.stamp_ns.is_some() && truth.has_heading()).then_some(truth)
}

fn run(source: &Source, row: &Row, scans: usize) -> Result<Trajectory, Failure> {
    let mut changes = row.changes();
    changes.push(format!("source.scans={scans}"));
    let out = source.runs.join(row.folder());
    accuracy::run(&source.sequence, row.name, &changes, &out)?;
    Ok(read_trajectory(&out.join("trajectory.tum"))?)
}

fn errors(odometry: &Trajectory, truth: &Trajectory, source: &Source) -> Option<SearchErrors> {
    let evaluation = judge(odometry, truth, Options::default());
    let judged = evaluation
        .inspect_err(|error| print::note(format_args!("{}: not compared with the truth: {error}", source.role)))
        .ok()?;
    let rpe = judged.rpe.as_ref()?;
    Some(SearchErrors {
        motions: rpe.pairs.len(),
        path_m: judged.path_m,
        translation_rmse_m: rpe.translation_rmse_m,
        rotation_rmse_deg: rpe.rotation_rmse_deg,
        ate_m: judged.ate.rmse_m,
        seg_percent: judged.seg.as_ref().map(|seg| seg.percent),
    })
}
