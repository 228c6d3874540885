//! The evaluation of a trajectory against ground truth, as `gyre run` and `gyre evaluate` both
//! report it: its errors, and the consistency of its covariances.

use std::fmt;

use gyre_evaluation::{
    Association, Bands, Coverage, Evaluation, EvaluationError, MatchedMotions, Nees, NeesOptions,
    Options, TimedMotion, bands, nees,
    plot::{bands_svg, errors_svg, trajectory_svg},
};
use gyre_radar::Trajectory;
use gyre_terminal::Failure;
use serde::Serialize;

/// The evaluation with the NEES of its covariances. `Display` is a table, the alternate form a
/// longer one.
#[derive(Debug, Serialize)]
pub struct Judgement {
    #[serde(flatten)]
    evaluation: Evaluation,
    /// `None`: there are no covariances, or the truth cannot judge them.
    #[serde(skip_serializing_if = "Option::is_none")]
    nees: Option<Nees>,
    /// Share of the poses whose error in x, y, yaw is within three standard deviations of what
    /// their covariance says, %.
    #[serde(skip_serializing_if = "Option::is_none")]
    within_3_sigma_percent: Option<[f64; 3]>,
    #[serde(skip)]
    bands: Option<Bands>,
}

impl Judgement {
    /// Adds the consistency of the motions' covariances.
    pub fn new(
        evaluation: Evaluation,
        motions: Option<&MatchedMotions>,
        options: &NeesOptions,
    ) -> Self {
        let nees = motions.map(|motions| nees(motions, options));
        let bands = motions.map(|motions| bands(motions, options.truth_sigma));
        let within_3_sigma_percent = bands.as_ref().map(|bands| bands.inside_percent(3.0));
        Self {
            evaluation,
            nees,
            within_3_sigma_percent,
            bands,
        }
    }

    /// Draws the trajectory, errors where the truth has heading, and bands where there are
    /// covariances: names and SVG documents.
    ///
    /// # Errors
    /// A plot that cannot be drawn.
    pub fn plots(&self) -> Result<Vec<(&'static str, String)>, Failure> {
        let matched = &self.evaluation.matched;
        let mut plots = vec![(
            "trajectory.svg",
            trajectory_svg(matched.estimate(), Some(matched))?,
        )];
        if self.evaluation.rpe.is_some() {
            plots.push(("errors.svg", errors_svg(&self.evaluation)?));
        }
        if let Some(bands) = &self.bands {
            plots.push(("bands.svg", bands_svg(bands)?));
        }
        Ok(plots)
    }
}

impl fmt::Display for Judgement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.evaluation.fmt(f)?;
        if let Some([x, y, yaw]) = self.within_3_sigma_percent {
            write!(
                f,
                "\nwithin        3 sigma of the pose: x {x:.0} %, y {y:.0} %, yaw {yaw:.0} %"
            )?;
        }
        let Some(nees) = &self.nees else {
            return Ok(());
        };
        write!(f, "\n\n")?;
        nees.fmt(f)
    }
}

/// Evaluates by time where both have stamps, else pose by pose.
///
/// # Errors
/// Trajectories that do not overlap.
pub fn judge(
    estimate: &Trajectory,
    truth: &Trajectory,
    options: Options,
) -> Result<Evaluation, EvaluationError> {
    match (&estimate.stamp_ns, &truth.stamp_ns) {
        (Some(_), Some(_)) => gyre_evaluation::evaluate(timed(estimate), timed(truth), &options),
        _ => {
            let options = Options {
                association: Association::Index,
                ..options
            };
            gyre_evaluation::evaluate(untimed(estimate), untimed(truth), &options)
        }
    }
}

/// Compares motions with the truth against which their trajectory was evaluated.
///
/// # Errors
/// A truth without times, without heading, or with other axes.
pub fn judge_motions(
    motions: &[TimedMotion],
    truth: &Trajectory,
    evaluation: &Evaluation,
) -> Result<MatchedMotions, Failure> {
    let Coverage::Time { max_gap_ns, .. } = evaluation.coverage else {
        return Err(
            "covariances are judged by time, and estimate or ground truth has no stamps".into(),
        );
    };
    let axes = &evaluation.axes;
    if axes.truth_lacks_heading || axes.y_negated || axes.heading_negated {
        return Err(
            "covariances need a ground truth with heading and with axes as the estimate's".into(),
        );
    }
    Ok(MatchedMotions::new(motions, timed(truth), max_gap_ns)?)
}

fn timed(trajectory: &Trajectory) -> gyre_evaluation::TimedPoses<'_> {
    gyre_evaluation::TimedPoses::new(
        trajectory.stamp_ns.as_deref().unwrap_or_default(),
        &trajectory.poses,
    )
}

fn untimed(trajectory: &Trajectory) -> gyre_evaluation::TimedPoses<'_> {
    gyre_evaluation::TimedPoses::untimed(&trajectory.poses)
}
