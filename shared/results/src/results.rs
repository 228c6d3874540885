//! Results of a run in `--out`, all made from the journal: an interrupted run leaves the same
//! files.
//!
//! The journal is read once, from its start to its end, and only the inputs of results are kept: a
//! month takes no more memory than a minute. Only an evaluation needs all poses.

mod files;
mod map;
mod objects;
mod pass;
mod sketch;
mod slam;

use std::path::{Path, PathBuf};

use files::Files;
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_contract::StageId;
use gyre_datasets::ground_truth::{find_ground_truth, read_trajectory};
use gyre_radar::Trajectory;
use pass::{MOST_JUDGED, Read};
use slam::Slam;

use crate::{
    evaluation::{NeesOptions, plot::bands_svg},
    judgement::{Judgement, judge, judge_motions, note_time_offset},
    out::{Out, SIMULATED_TRUTH, SUMMARY},
    summary::{Measured, Session, SlamSummary, Summary},
};

pub use map::map_options;

#[derive(Debug)]
pub struct Results {
    pub poses: usize,
    pub ended: bool,
    pub summary: Summary,
}

/// Writes all files from the journal. Each is written aside first, and none takes its place before
/// all are complete; a result of an earlier session that cannot be made any more is removed. They
/// survive a power failure when this returns. Existing results stay if `make_way`, which is called
/// before the first one is replaced, decides that results of so many poses do not replace them.
pub fn write(
    configuration: &Configuration,
    out: &Out,
    session: &Session<'_>,
    make_way: &dyn Fn(usize) -> Result<bool, Failure>,
) -> Result<Results, Failure> {
    let truth = truth_of(configuration, out.path());
    let mut slam = slam_of(configuration, out);
    let mut files = Files::new(out);
    // Loops are compared with the poses too.
    let (resumed, is_judged) = (session.resumed, truth.is_some() || slam.is_some());
    let mut read = pass::read(&mut files, out.path(), resumed, is_judged, slam.as_ref())?;
    let mut corrected = None;
    if let Some(slam) = &mut slam {
        corrected = Some(add_corrected(&mut files, slam, truth.as_deref(), &read)?);
        let trajectory = read.corrected_sketch.path();
        let png = map::map_png(configuration, out, slam, &trajectory)?;
        png.map_or(Ok(()), |png| files.add("map.png", png))?;
    }
    if configuration.objects.is_on() {
        files.add("objects.csv", objects::csv(out.path())?)?;
    }
    let gnss = slam.as_mut().map(Slam::gnss).transpose()?.flatten();
    let judgement = truth.and_then(|truth| judged(&truth, &read));
    let plots = match &judgement {
        Some(judgement) => judgement.plots()?,
        None => Vec::from_iter(read.sketch.svg()?.map(|svg| ("trajectory.svg", svg))),
    };
    for (name, plot) in plots {
        files.add(name, plot)?;
    }
    let (first, refines) = (
        configuration.source.first,
        configuration.has(StageId::Refinement),
    );
    let measured = Measured {
        course: read.counter.course(read.sketch.length_m),
        counts: read.counter.counts(read.end.as_ref(), first, refines),
        latency: read.latency.latency(),
        evaluation: judgement,
        slam: corrected,
        gnss,
    };
    let latency = serde_json::to_string_pretty(&measured.latency)?;
    files.add("latency.json", latency)?;
    let results = Results {
        poses: measured.counts.processed as usize,
        ended: read.end.is_some(),
        summary: Summary::new(configuration, out.path(), session, measured),
    };
    files.add(SUMMARY, serde_json::to_string_pretty(&results.summary)?)?;
    if make_way(results.poses)? {
        files.commit()?;
    }
    Ok(results)
}

/// Without the corrected trajectory the run has all other results.
fn slam_of(configuration: &Configuration, out: &Out) -> Option<Slam> {
    let note = |reason: &Failure| print::note(format_args!("no corrected trajectory: {reason}"));
    let slam = Slam::read(configuration, out).inspect_err(note);
    slam.ok().flatten()
}

pub fn truth_of(configuration: &Configuration, out: &Path) -> Option<PathBuf> {
    let given = configuration.run.ground_truth.clone();
    let simulated = || {
        configuration
            .simulation
            .is_some()
            .then(|| out.join(SIMULATED_TRUTH))
    };
    let data = Some(&configuration.source.data).filter(|data| !data.as_os_str().is_empty());
    let beside = || data.and_then(|data| find_ground_truth(data));
    given.or_else(simulated).or_else(beside)
}

/// Adds the results of SLAM but for the trajectory itself and the map.
fn add_corrected(
    files: &mut Files<'_>,
    slam: &mut Slam,
    truth: Option<&Path>,
    Read {
        trajectory,
        corrected,
        ..
    }: &Read,
) -> Result<SlamSummary, Failure> {
    files.add("loops.csv", slam.loops_csv()?)?;
    files.add("graph.g2o", slam.graph_g2o())?;
    let mut summary = slam.summary();
    summary.odometry = slam.errors_of(trajectory);
    // The evaluation of odometry reports an unusable truth.
    let truth = truth.and_then(|path| read_trajectory(path).ok());
    let Some(truth) = truth.filter(|_| corrected.len() > 1) else {
        return Ok(summary);
    };
    if let Ok(evaluation) = judge(corrected, &truth) {
        summary.ate_m = Some(evaluation.ate.rmse_m);
        let are_as_given = evaluation.axes.are_as_given();
        summary.ground_truth = are_as_given.then(|| slam.errors_of(&truth)).flatten();
    }
    let bands = slam.bands(&truth).and_then(|bands| Ok(bands_svg(&bands)?));
    match bands {
        Ok(svg) => files.add("bands_slam.svg", svg)?,
        Err(reason) => print::note(format_args!("no bands_slam.svg: {reason}")),
    }
    Ok(summary)
}

/// Evaluates the trajectory and its covariances against the ground truth, if that fits.
fn judged(path: &Path, estimate: &Read) -> Option<Judgement> {
    if estimate.are_too_many {
        let truth = path.display();
        print::note(format_args!(
            "not evaluated against {truth}: more than {MOST_JUDGED} poses are too many to keep in memory beside a run: use gyre evaluate"
        ));
    }
    if estimate.trajectory.poses.len() < 2 {
        return None;
    }
    let by = |truth: Trajectory| -> Result<Judgement, Failure> {
        note_time_offset(&estimate.trajectory, &truth);
        let evaluation = judge(&estimate.trajectory, &truth)?;
        let motions = judge_motions(&estimate.motions, &truth, &evaluation)
            .inspect_err(|reason| print::note(format_args!("no NEES and no bands.svg: {reason}")));
        let options = NeesOptions::default();
        let motions = motions.ok();
        Ok(Judgement::new(evaluation, motions.as_ref(), &options, None))
    };
    let truth = read_trajectory(path).map_err(Failure::from);
    let note = |reason: &Failure| {
        let truth = path.display();
        print::note(format_args!("not evaluated against {truth}: {reason}"));
    };
    truth.and_then(by).inspect_err(note).ok()
}
