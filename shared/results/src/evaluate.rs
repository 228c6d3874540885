//! `gyre evaluate`: evaluates a trajectory against ground truth.

mod arguments;
mod objects;

use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, Command, FromArgMatches};
use gyre_configuration::{
    Configuration,
    terminal::{Failure, print},
};
use gyre_datasets::ground_truth::read_trajectory;
use gyre_radar::Trajectory;

use crate::{
    evaluation::{Evaluation, MatchedMotions, NeesOptions, TimedMotion, TruthSigma, part},
    judgement::{Judgement, judge_motions, note_time_offset, take_time_offset_out},
    odometry,
    out::{Content, Out, require_results},
    results::truth_of,
};

pub use arguments::EvaluateArguments;

pub fn evaluate(arguments: &EvaluateArguments) -> Result<ExitCode, Failure> {
    if arguments.objects {
        return evaluate_objects(arguments);
    }
    let [file, truth] = files(arguments)?;
    let (estimate, mut truth) = (read_trajectory(&file)?, read_trajectory(&truth)?);
    let mut offset = None;
    match arguments.find_time_offset {
        true => offset = Some(take_time_offset_out(&estimate, &mut truth)?),
        false => note_time_offset(&estimate, &truth),
    }
    let evaluation = crate::evaluation::evaluate(&estimate, &truth, arguments.step)?;
    let motions = judged_motions(arguments, &file, &estimate, &truth, &evaluation)?;
    let options = NeesOptions {
        lengths: arguments.nees_lengths.clone(),
        truth_sigma: TruthSigma {
            position_m: arguments.truth_sigma_m,
            yaw_rad: arguments.truth_sigma_deg.to_radians(),
        },
    };
    let judgement = Judgement::new(evaluation, motions.as_ref(), &options, offset);
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&judgement)?)?,
        false => print::line(format_args!("{judgement:#}"))?,
    }
    if let Some(directory) = &arguments.plots {
        let folder = crate::absolute(&file).ok();
        let folder = folder.as_deref().and_then(Path::parent);
        let is_of_estimate =
            folder.is_some() && folder == crate::absolute(directory).ok().as_deref();
        let locked = (!is_of_estimate).then(|| Out::lock_for(directory, Content::PLOTS));
        let _locked = locked.transpose()?;
        for (name, plot) in judgement.plots()? {
            gyre_storage::write(&directory.join(name), plot)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn evaluate_objects(arguments: &EvaluateArguments) -> Result<ExitCode, Failure> {
    let Some(truth) = &arguments.ground_truth else {
        return Err("name a run and the recording with its true objects: gyre evaluate --objects RUN RECORDING".into());
    };
    let errors = objects::evaluate(&arguments.estimate, truth)?;
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&errors)?)?,
        false => print::line(errors)?,
    }
    Ok(ExitCode::SUCCESS)
}

impl EvaluateArguments {
    /// Returns the run that is to be compared with itself: it has no ground truth, or that is not
    /// wanted. No option may compare it with one.
    pub fn run_alone(&self) -> Result<Option<&Path>, Failure> {
        let run = self.estimate.as_path();
        let is_alone = || self.alone || run.is_dir() && truth_of_run(run).is_err();
        match self.is_plain() {
            true => Ok(is_alone().then_some(run)),
            false if self.alone => {
                Err("--alone compares with no ground truth: leave out the options that do".into())
            }
            false => Ok(None),
        }
    }

    /// Returns whether nothing but a trajectory is named, with `--alone` or without.
    fn is_plain(&self) -> bool {
        let command = Self::augment_args(Command::new("evaluate").no_binary_name(true));
        let words = [OsStr::new("--"), self.estimate.as_os_str()];
        let parsed = command.try_get_matches_from(words);
        let plain = parsed.and_then(|parsed| Self::from_arg_matches(&parsed));
        plain.is_ok_and(|plain| {
            Self {
                alone: self.alone,
                ..plain
            } == *self
        })
    }
}

/// Returns the files that are compared: of a run, its trajectory and its ground truth.
fn files(arguments: &EvaluateArguments) -> Result<[PathBuf; 2], Failure> {
    let (estimate, given) = (&arguments.estimate, arguments.ground_truth.clone());
    if !estimate.is_dir() {
        let shown = estimate.display();
        let lacks = || format!("name the ground truth too: gyre evaluate {shown} FILE");
        let truth = given.ok_or_else(lacks)?;
        return Ok([estimate.clone(), truth]);
    }
    require_results(estimate)?;
    let truth = given.map_or_else(|| truth_of_run(estimate), Ok)?;
    Ok([estimate.join("trajectory.tum"), truth])
}

/// Returns the ground truth of a run: its own, or the truth of its recording.
pub fn truth_of_run(run: &Path) -> Result<PathBuf, Failure> {
    let configuration = Configuration::read(&run.join("config.toml"), &[])?;
    let none = || {
        let run = run.display();
        format!("the run in {run} has no ground truth: name one, gyre evaluate {run} FILE")
    };
    Ok(truth_of(&configuration, run).ok_or_else(none)?)
}

/// Returns the motions of the odometry that was named, or of the one beside the estimate if it
/// fits.
fn judged_motions(
    arguments: &EvaluateArguments,
    file: &Path,
    estimate: &Trajectory,
    truth: &Trajectory,
    evaluation: &Evaluation,
) -> Result<Option<MatchedMotions>, Failure> {
    let judge = |motions: &[TimedMotion]| {
        judge_motions(part(motions, &arguments.nees_part), truth, evaluation)
    };
    if let Some(path) = &arguments.odometry {
        return judge(&odometry::read(path)?).map(Some);
    }
    let beside = file.with_file_name("odometry.csv");
    if !beside.is_file() {
        return Ok(None);
    }
    let judged = odometry::read(&beside).and_then(|motions| match has_stamps(estimate, &motions) {
        true => judge(&motions),
        false => Err("its stamps are not the estimate's".into()),
    });
    let note = |reason: &Failure| {
        let file = beside.display();
        print::note(format_args!("{file} is not evaluated: {reason}"));
    };
    Ok(judged.inspect_err(note).ok())
}

const ROUNDING_NS: i64 = 1_000;

fn has_stamps(trajectory: &Trajectory, motions: &[TimedMotion]) -> bool {
    let stamps = trajectory.stamps();
    motions.iter().all(|motion| {
        let first = motion.to_ns.saturating_sub(ROUNDING_NS);
        let next = stamps.get(stamps.partition_point(|stamp| *stamp < first));
        next.is_some_and(|stamp| *stamp <= motion.to_ns.saturating_add(ROUNDING_NS))
    })
}

#[cfg(test)]
mod tests {
    use gyre_geometry::OdometryMotion;

    use super::*;

    #[test]
    fn an_odometry_fits_where_all_its_motions_end_at_poses_but_for_rounding() {
        let stamps = vec![1_000_000_000, 1_250_000_400, 1_500_000_000];
        let trajectory = Trajectory::timed(stamps, Vec::new());
        let ends_at = |to_ns| TimedMotion {
            from_ns: 0,
            to_ns,
            estimate: OdometryMotion::default(),
        };
        for (end_ns, fits) in [
            (1_500_000_999, true),
            (1_400_000_000, false),
            (1_500_001_001, false),
        ] {
            let motions = [ends_at(1_250_000_000), ends_at(end_ns)];
            assert_eq!(has_stamps(&trajectory, &motions), fits, "{end_ns}");
        }
        assert!(!has_stamps(&Trajectory::default(), &[ends_at(0)]));
    }
}
