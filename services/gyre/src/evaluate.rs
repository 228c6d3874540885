//! `gyre evaluate`: a trajectory judged by ground truth.

use std::{fs, path::Path, process::ExitCode};

use gyre_evaluation::{
    Association, Bands, Coverage, Evaluation, EvaluationError, JudgedMotions, Motion, Nees, NeesOptions, Options,
    TruthSigma, bands, nees, plot_bands, plot_errors, plot_trajectory,
};
use gyre_radar::{Trajectory, ground_truth::read_trajectory};
use serde::Serialize;

use crate::{Failure, cli::EvaluateArguments, odometry, print};

/// Prints how well an estimate fits the truth, as a table or as JSON, and draws both.
pub fn evaluate(arguments: &EvaluateArguments) -> Result<ExitCode, Failure> {
    let estimate = read_trajectory(&arguments.estimate)?;
    let truth = read_trajectory(&arguments.ground_truth)?;
    let evaluation = judge(&estimate, &truth, Options { step: arguments.step, ..Options::default() })?;
    let motions = judged_motions(arguments, &estimate, &truth, &evaluation)?;
    let truth_sigma =
        TruthSigma { position_m: arguments.truth_sigma_m, yaw_rad: arguments.truth_sigma_deg.to_radians() };
    let options = NeesOptions { lengths: arguments.nees_lengths.clone(), truth_sigma };
    let nees = motions.as_ref().map(|motions| nees(motions, &options));
    show(arguments.json, &evaluation, nees)?;
    if let Some(directory) = &arguments.plots {
        fs::create_dir_all(directory).map_err(|error| format!("cannot make {}: {error}", directory.display()))?;
        let bands = motions.map(|motions| bands(&motions, truth_sigma));
        draw(directory, &evaluation, bands.as_ref())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Compares by time where both have stamps, else pose by pose.
pub fn judge(estimate: &Trajectory, truth: &Trajectory, options: Options) -> Result<Evaluation, EvaluationError> {
    match (&estimate.stamp_ns, &truth.stamp_ns) {
        (Some(_), Some(_)) => gyre_evaluation::evaluate(timed(estimate), timed(truth), &options),
        _ => {
            let options = Options { association: Association::Index, ..options };
            gyre_evaluation::evaluate(untimed(estimate), untimed(truth), &options)
        }
    }
}

/// Holds motions against the truth by which the trajectory that they make was judged.
pub fn judge_motions(
    motions: &[Motion],
    truth: &Trajectory,
    evaluation: &Evaluation,
) -> Result<JudgedMotions, Failure> {
    let Coverage::Time { max_gap_ns, .. } = evaluation.coverage else {
        return Err("covariances are judged by time, and estimate or ground truth has no stamps".into());
    };
    let axes = &evaluation.axes;
    if axes.truth_lacks_heading || axes.y_negated || axes.heading_negated {
        return Err("covariances need a ground truth with heading and with axes as the estimate's".into());
    }
    Ok(JudgedMotions::new(motions, timed(truth), max_gap_ns)?)
}

/// Draws all there is: trajectory, errors where the truth has heading, bands where there are covariances.
pub fn draw(directory: &Path, evaluation: &Evaluation, bands: Option<&Bands>) -> Result<(), Failure> {
    let matched = &evaluation.matched;
    plot_trajectory(&directory.join("trajectory.svg"), matched.estimate(), Some(matched.truth()))?;
    if evaluation.rpe.is_some() {
        plot_errors(&directory.join("errors.svg"), evaluation)?;
    }
    if let Some(bands) = bands {
        plot_bands(&directory.join("bands.svg"), bands)?;
    }
    Ok(())
}

/// The motions of the odometry that was named, or of the one beside the estimate if it fits.
fn judged_motions(
    arguments: &EvaluateArguments,
    estimate: &Trajectory,
    truth: &Trajectory,
    evaluation: &Evaluation,
) -> Result<Option<JudgedMotions>, Failure> {
    if let Some(path) = &arguments.odometry {
        return judge_motions(&odometry::read(path)?, truth, evaluation).map(Some);
    }
    let beside = arguments.estimate.with_file_name("odometry.csv");
    if !beside.is_file() {
        return Ok(None);
    }
    let judged = odometry::read(&beside).and_then(|motions| match has_stamps(estimate, &motions) {
        true => judge_motions(&motions, truth, evaluation),
        false => Err("its stamps are not the estimate's".into()),
    });
    let note = |reason: &Failure| print::note(format_args!("{} is not judged: {reason}", beside.display()));
    Ok(judged.inspect_err(note).ok())
}

/// Trajectories may be written in microseconds.
const ROUNDING_NS: i64 = 1_000;

/// Whether every motion ends at a pose of the trajectory.
fn has_stamps(trajectory: &Trajectory, motions: &[Motion]) -> bool {
    let stamps = trajectory.stamp_ns.as_deref().unwrap_or_default();
    motions.iter().all(|motion| {
        let next = stamps.partition_point(|stamp| *stamp < motion.to_ns.saturating_sub(ROUNDING_NS));
        stamps.get(next).is_some_and(|stamp| *stamp <= motion.to_ns.saturating_add(ROUNDING_NS))
    })
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Judgement<'a> {
    #[serde(flatten)]
    evaluation: &'a Evaluation,
    #[serde(skip_serializing_if = "Option::is_none")]
    nees: Option<Nees>,
}

fn show(json: bool, evaluation: &Evaluation, nees: Option<Nees>) -> Result<(), Failure> {
    if json {
        return print::line(serde_json::to_string_pretty(&Judgement { evaluation, nees })?);
    }
    print::line(format_args!("{evaluation:#}"))?;
    nees.map_or(Ok(()), |nees| print::line(format_args!("\n{nees}")))
}

fn timed(trajectory: &Trajectory) -> gyre_evaluation::Trajectory<'_> {
    gyre_evaluation::Trajectory::new(trajectory.stamp_ns.as_deref().unwrap_or_default(), &trajectory.poses)
}

fn untimed(trajectory: &Trajectory) -> gyre_evaluation::Trajectory<'_> {
    gyre_evaluation::Trajectory::untimed(&trajectory.poses)
}

#[cfg(test)]
mod tests {
    use gyre_evaluation::UncertainMotion;

    use super::*;

    #[test]
    fn an_odometry_fits_where_all_its_motions_end_at_poses_but_for_rounding() {
        let stamps = vec![1_000_000_000, 1_250_000_400, 1_500_000_000];
        let trajectory = Trajectory { stamp_ns: Some(stamps), poses: Vec::new() };
        let ends_at = |to_ns| Motion { from_ns: 0, to_ns, estimate: UncertainMotion::standing() };
        assert!(has_stamps(&trajectory, &[ends_at(1_250_000_000), ends_at(1_500_000_999)]));
        assert!(!has_stamps(&trajectory, &[ends_at(1_250_000_000), ends_at(1_400_000_000)]));
        assert!(!has_stamps(&trajectory, &[ends_at(1_500_001_001)]));
        assert!(!has_stamps(&Trajectory::default(), &[ends_at(0)]));
    }
}
