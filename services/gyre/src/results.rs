//! Results of a run in `--out`, all made from the journal: an interrupted run leaves the same files.

use std::path::Path;

use gyre_evaluation::{NeesOptions, Options, plot::trajectory_svg};
use gyre_messages::{PoseHeader, StageId, flag};
use gyre_pose_integration::journal;
use gyre_radar::{
    Trajectory,
    ground_truth::{find_ground_truth, read_trajectory, write_tum},
};
use gyre_storage::{self as storage, Draft};

use crate::{
    Failure,
    configuration::Configuration,
    judgement::{Judgement, judge, judge_motions},
    latency::Latency,
    odometry,
    out::Out,
    print,
    summary::{Counts, MotionCounts, Session, Summary},
};

/// The ground truth of a simulation that is played without being stored.
pub const SIMULATED_TRUTH: &str = "ground_truth.tum";
/// All results.
pub const FILES: [&str; 8] = [
    "odometry.csv",
    "trajectory.tum",
    "trajectory.svg",
    "errors.svg",
    "bands.svg",
    "latency.json",
    "summary.json",
    SIMULATED_TRUTH,
];

/// What was written.
#[derive(Debug)]
pub struct Results {
    /// Poses in the journal.
    pub poses: usize,
    /// Whether the journal has its end.
    pub ended: bool,
    /// The summary to print.
    pub summary: Summary,
}

/// Writes all files from the journal. Each is written aside first, and none takes its place before all are
/// complete. They survive a power failure when this returns.
///
/// # Errors
/// A file that cannot be written.
pub fn write(
    configuration: &Configuration,
    out: &Out,
    session: &Session<'_>,
) -> Result<Results, Failure> {
    let records = journal::read(&journal::path(out.path()))?;
    let end = records.last().filter(|last| last.item.is(flag::END));
    let poses = &records[..records.len() - usize::from(end.is_some())];
    let trajectory = odometry::trajectory(poses);
    let mut files = Files::new(out);
    files.add("odometry.csv", odometry::csv(poses))?;
    let mut tum = Vec::new();
    write_tum(&trajectory, &mut tum)?;
    files.add("trajectory.tum", tum)?;
    let judgement = judged(configuration, out.path(), poses, &trajectory);
    for (name, plot) in plots(&trajectory, judgement.as_ref())? {
        files.add(name, plot)?;
    }
    let latency = Latency::of(&poses[session.resumed.min(poses.len())..]);
    files.add("latency.json", serde_json::to_string_pretty(&latency)?)?;
    let motions = configuration
        .has(StageId::Refinement)
        .then(|| MotionCounts::of(poses));
    let counts = Counts {
        motions,
        ..Counts::of(poses, end, configuration.source.first)
    };
    let summary = Summary::new(
        configuration,
        out.path(),
        session,
        counts,
        latency,
        judgement,
    );
    files.add("summary.json", serde_json::to_string_pretty(&summary)?)?;
    files.commit()?;
    Ok(Results {
        poses: poses.len(),
        ended: end.is_some(),
        summary,
    })
}

/// Results that are complete but for taking their places.
struct Files<'a> {
    out: &'a Out,
    drafts: Vec<Draft>,
}

impl<'a> Files<'a> {
    fn new(out: &'a Out) -> Self {
        Self {
            out,
            drafts: Vec::new(),
        }
    }

    fn add(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        let mut draft = Draft::create(&self.out.join(name))?;
        draft.append(content)?;
        self.drafts.push(draft);
        Ok(())
    }

    fn commit(self) -> Result<(), Failure> {
        self.drafts.into_iter().try_for_each(Draft::commit)?;
        Ok(storage::sync_folder(self.out.path())?)
    }
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

fn plots(
    trajectory: &Trajectory,
    judgement: Option<&Judgement>,
) -> Result<Vec<(&'static str, String)>, Failure> {
    match judgement {
        Some(judgement) => judgement.plots(),
        None if trajectory.poses.is_empty() => Ok(Vec::new()),
        None => Ok(vec![(
            "trajectory.svg",
            trajectory_svg(&trajectory.poses, None)?,
        )]),
    }
}
