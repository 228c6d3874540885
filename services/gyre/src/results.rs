//! Results of a run in `--out`, all made from the journal: an interrupted run leaves the same files.

use std::{fs, path::Path};

use gyre_evaluation::{NeesOptions, Options, plot_trajectory};
use gyre_messages::{PoseHeader, StageId, flag};
use gyre_radar::{
    Trajectory,
    ground_truth::{find_ground_truth, read_trajectory, write_tum},
};
use gyre_stage::supervise::Report;

use crate::{
    Failure,
    configuration::Configuration,
    judgement::{Judgement, judge, judge_motions},
    latency::Latency,
    odometry, print,
    summary::{Counts, MotionCounts, Session, Summary},
};

/// The ground truth of a simulation that is played without being stored.
pub const SIMULATED_TRUTH: &str = "ground_truth.tum";

/// Writes all files, and returns the summary to print.
///
/// # Errors
/// A file that cannot be written.
pub fn write(
    configuration: &Configuration,
    out: &Path,
    session: &Session<'_>,
    records: &[PoseHeader],
    report: Option<&Report>,
) -> Result<Summary, Failure> {
    let end = records.last().filter(|last| last.item.is(flag::END));
    let poses = &records[..records.len() - usize::from(end.is_some())];
    let trajectory = odometry::trajectory(poses);
    save(out, "odometry.csv", odometry::csv(poses))?;
    let mut tum = Vec::new();
    write_tum(&trajectory, &mut tum)?;
    save(out, "trajectory.tum", tum)?;
    let judgement = judged(configuration, out, poses, &trajectory);
    draw(out, &trajectory, judgement.as_ref())?;
    let latency = Latency::of(&poses[session.resumed.min(poses.len())..]);
    save(out, "latency.json", serde_json::to_string_pretty(&latency)?)?;
    let motions = configuration
        .has(StageId::Refinement)
        .then(|| MotionCounts::of(poses));
    let counts = Counts {
        motions,
        ..Counts::of(poses, end, configuration.source.first)
    };
    let summary = Summary::new(
        configuration,
        out,
        session,
        counts,
        latency,
        judgement,
        report,
    );
    save(out, "summary.json", serde_json::to_string_pretty(&summary)?)?;
    Ok(summary)
}

/// Evaluates the trajectory and its covariances against the dataset's ground truth, where there is one that fits.
fn judged(
    configuration: &Configuration,
    out: &Path,
    poses: &[PoseHeader],
    trajectory: &Trajectory,
) -> Option<Judgement> {
    if poses.len() < 2 {
        return None;
    }
    let given = configuration.run.ground_truth.clone();
    let simulated = || configuration.streamed().map(|_| out.join(SIMULATED_TRUTH));
    let path = given
        .or_else(simulated)
        .or_else(|| find_ground_truth(&configuration.source.data))?;
    let by = |truth: Trajectory| -> Result<Judgement, Failure> {
        let evaluation = judge(trajectory, &truth, Options::default())?;
        let motions = judge_motions(&odometry::motions(poses), &truth, &evaluation)
            .inspect_err(|reason| print::note(format_args!("no NEES and no bands.svg: {reason}")));
        Ok(Judgement::new(
            evaluation,
            motions.ok().as_ref(),
            &NeesOptions::default(),
        ))
    };
    let judged = read_trajectory(&path).map_err(Failure::from).and_then(by);
    judged
        .inspect_err(|reason| {
            print::note(format_args!(
                "not evaluated against {}: {reason}",
                path.display()
            ))
        })
        .ok()
}

fn draw(out: &Path, trajectory: &Trajectory, judgement: Option<&Judgement>) -> Result<(), Failure> {
    match judgement {
        Some(judgement) => judgement.draw(out),
        None if trajectory.poses.is_empty() => Ok(()),
        None => Ok(plot_trajectory(
            &out.join("trajectory.svg"),
            &trajectory.poses,
            None,
        )?),
    }
}

fn save(out: &Path, name: &str, text: impl AsRef<[u8]>) -> Result<(), Failure> {
    let path = out.join(name);
    fs::write(&path, text)
        .map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}
