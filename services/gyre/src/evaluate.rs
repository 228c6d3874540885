//! `gyre evaluate`: a trajectory judged by ground truth.

use std::{fs, process::ExitCode};

use gyre_evaluation::{Association, Evaluation, EvaluationError, Options, plot_errors, plot_trajectory};
use gyre_radar::{Trajectory, ground_truth::read_trajectory};

use crate::{Failure, cli::EvaluateArguments, print};

/// Prints how well an estimate fits the truth, as a table or as JSON, and draws both.
pub fn evaluate(arguments: &EvaluateArguments) -> Result<ExitCode, Failure> {
    let estimate = read_trajectory(&arguments.estimate)?;
    let truth = read_trajectory(&arguments.ground_truth)?;
    let evaluation = judge(&estimate, &truth, Options { step: arguments.step, ..Options::default() })?;
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&evaluation)?)?,
        false => print::line(format_args!("{evaluation:#}"))?,
    }
    if let Some(directory) = &arguments.plots {
        fs::create_dir_all(directory).map_err(|error| format!("cannot make {}: {error}", directory.display()))?;
        let matched = &evaluation.matched;
        plot_trajectory(&directory.join("trajectory.svg"), matched.estimate(), Some(matched.truth()))?;
        plot_errors(&directory.join("errors.svg"), &evaluation)?;
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

fn timed(trajectory: &Trajectory) -> gyre_evaluation::Trajectory<'_> {
    gyre_evaluation::Trajectory::new(trajectory.stamp_ns.as_deref().unwrap_or_default(), &trajectory.poses)
}

fn untimed(trajectory: &Trajectory) -> gyre_evaluation::Trajectory<'_> {
    gyre_evaluation::Trajectory::untimed(&trajectory.poses)
}
