//! `gyre-lab slam`: closes the loops of a run, corrects its trajectory, and compares both with the
//! ground truth.

mod figures;
mod wrong;

use std::{convert::Infallible, path::PathBuf, process::ExitCode, time::Instant};

use clap::Args;
use figures::{Figures, loops_table};
use gyre_configuration::terminal::Failure;
use gyre_slam::{estimation::Constraint, EstimatorKind, LoopCloser, Query, SUBMAP_REACH_M, TrajectoryEstimator};

use crate::{drive::Drive, report::{make_folder, publish}};

#[derive(Debug, Args)]
pub struct SlamArguments {
    /// The results of a run with `slam.kind=graph` or `filter`. Its recording needs a ground truth.
    pub run: PathBuf,
    /// A loop is wrong if it is farther from the ground truth, m.
    #[arg(long, default_value = "2")]
    pub wrong_m: f64,
    /// Correct by the extended Kalman filter instead of the pose graph.
    #[arg(long)]
    pub filter: bool,
    /// Number of wrong loops that are added to see what they do, single and in tens that agree.
    #[arg(long, default_value = "50")]
    pub wrong_loops: usize,
    /// The folder of slam.md and slam.json.
    #[arg(long, default_value = "out/slam")]
    pub out: PathBuf,
}

/// Closes loops, corrects, and measures.
///
/// # Errors
/// Results that cannot be read or have no keyframes, or a recording without ground truth.
pub fn slam(arguments: &SlamArguments) -> Result<ExitCode, Failure> {
    let drive = Drive::read(&arguments.run)?;
    make_folder(&arguments.out)?;
    let start = Instant::now();
    let queries = queries(&drive)?;
    let closing = start.elapsed();
    let kind = match arguments.filter {
        true => EstimatorKind::Filter,
        false => EstimatorKind::Graph,
    };
    let mut rows = vec![Figures::before(&drive)?.row("odometry")];
    let count = arguments.wrong_loops;
    let injected = [
        ("corrected", Vec::new()),
        ("with wrong loops", wrong::loops(&drive, count, 1)),
        ("with wrong loops in tens", wrong::loops(&drive, count, 10)),
    ];
    for (name, wrong) in injected {
        let start = Instant::now();
        let mut estimator = estimate(&drive, &queries, &wrong, kind)?;
        let solved = start.elapsed();
        rows.push(Figures::after(&drive, &mut estimator, solved)?.row(name));
        if count == 0 {
            break;
        }
    }
    let tables = [
        loops_table(&drive, &queries, arguments.wrong_m, closing),
        figures::table(rows),
    ];
    publish("slam", &tables, &arguments.out)?;
    Ok(ExitCode::SUCCESS)
}

/// Closes all loops.
fn queries(drive: &Drive) -> Result<Vec<Query>, Failure> {
    let mut closer = LoopCloser::new(SUBMAP_REACH_M, &drive.refinement, drive.capacity)?;
    let mut read = |index: usize| Ok::<_, Infallible>(drive.keyframes[index].clone());
    let mut queries = Vec::new();
    for keyframe in &drive.keyframes {
        closer.push(keyframe)?;
    }
    closer.finish();
    while closer.describe(&mut read)?.is_some() {}
    while let Some(query) = closer.close(&mut read)? {
        queries.push(query);
    }
    Ok(queries)
}

/// Estimates the poses of all keyframes from odometry, loops and `wrong` ones.
fn estimate(
    drive: &Drive,
    queries: &[Query],
    wrong: &[Constraint],
    kind: EstimatorKind,
) -> Result<TrajectoryEstimator, Failure> {
    let mut estimator = TrajectoryEstimator::new(kind);
    let mut wrong = wrong.iter().peekable();
    for (keyframe, query) in drive.keyframes.iter().zip(queries) {
        estimator.push(keyframe)?;
        estimator.close(query)?;
        while let Some(closing) = wrong.next_if(|closing| closing.to == query.keyframe) {
            estimator.close_loop(closing)?;
        }
    }
    estimator.solve()?;
    Ok(estimator)
}
