//! The evaluation of a trajectory against ground truth, as `gyre run` and `gyre evaluate` both
//! report it: its errors, and the consistency of its covariances.

use std::fmt;

use crate::evaluation::{
    Bands, Coverage, Evaluation, EvaluationError, MatchedMotions, Nees, NeesOptions, STEP,
    TimedMotion, bands, nees,
    plot::{bands_svg, errors_svg, trajectory_svg},
};
use gyre_configuration::terminal::{Failure, print};
use gyre_radar::{ClockOffset, MAX_OFFSET_S, Trajectory, clock_offset};
use serde::Serialize;

/// The evaluation with the NEES of its covariances. `Display` is a table, the alternate form a
/// longer one.
#[derive(Debug, Serialize)]
pub struct Judgement {
    /// The removed delay of the clock of the ground truth, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_offset_s: Option<f64>,
    #[serde(flatten)]
    pub evaluation: Evaluation,
    /// `None`: there are no covariances, or the truth cannot judge them.
    #[serde(skip_serializing_if = "Option::is_none")]
    nees: Option<Nees>,
    /// Share of the poses whose error in x, y, yaw is within three standard deviations by their
    /// covariance, %.
    #[serde(skip_serializing_if = "Option::is_none")]
    within_3_sigma_percent: Option<[f64; 3]>,
    #[serde(skip)]
    bands: Option<Bands>,
}

impl Judgement {
    pub fn new(
        evaluation: Evaluation,
        motions: Option<&MatchedMotions>,
        options: &NeesOptions,
        time_offset_s: Option<f64>,
    ) -> Self {
        let bands = motions.map(|motions| bands(motions, options.truth_sigma));
        Self {
            time_offset_s,
            evaluation,
            nees: motions.map(|motions| nees(motions, options)),
            within_3_sigma_percent: bands.as_ref().map(|bands| bands.inside_percent(3.0)),
            bands,
        }
    }

    /// Draws the trajectory, errors where the truth has heading, and bands where there are
    /// covariances: names and SVG documents.
    pub fn plots(&self) -> Result<Vec<(&'static str, String)>, Failure> {
        let trajectory = trajectory_svg(&self.evaluation.matched)?;
        let mut plots = vec![("trajectory.svg", trajectory)];
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
        if let Some(delay_s) = self.time_offset_s {
            let word = if delay_s > 0.0 { "late" } else { "early" };
            let by = format!("{:.2} s {word}", delay_s.abs());
            writeln!(f, "time offset   the ground truth was {by}: taken out")?;
        }
        self.evaluation.fmt(f)?;
        if let Some([x, y, yaw]) = self.within_3_sigma_percent {
            let shares = format!("x {x:.0} %, y {y:.0} %, yaw {yaw:.0} %");
            write!(f, "\nwithin        3 sigma of the pose: {shares}")?;
        }
        if let Some(nees) = &self.nees {
            write!(f, "\n\n")?;
            nees.fmt(f)?;
        }
        Ok(())
    }
}

/// Reports a clock of the ground truth that differs from the estimate's clock.
pub fn note_time_offset(estimate: &Trajectory, truth: &Trajectory) {
    let differs = |offset: &ClockOffset| offset.is_reliable() && !offset.agrees();
    if let Some(offset) = clock_offset(estimate, truth).filter(differs) {
        print::note(format_args!(
            "the motions of the ground truth are {offset}: its clock differs (UTC and GPS time: 18 s, UTC and TAI: 37 s), or it is of \
             a different drive; `gyre evaluate --find-time-offset` takes that out"
        ));
    }
}

/// Sets the ground truth to the clock of the estimate; returns its delay, s.
pub fn take_time_offset_out(estimate: &Trajectory, truth: &mut Trajectory) -> Result<f64, Failure> {
    let found = clock_offset(estimate, truth).filter(ClockOffset::is_reliable);
    let found = found.ok_or_else(|| {
        format!(
            "cannot find the time offset: the motions of the estimate and of the ground truth do not agree at any offset within \
             {MAX_OFFSET_S} s, or one of them has no times"
        )
    })?;
    let late_ns = (found.delay_s * 1e9).round() as i64;
    *truth = std::mem::take(truth).earlier_by(late_ns);
    Ok(found.delay_s)
}

/// Evaluates by time where both have stamps, else pose by pose.
pub fn judge(estimate: &Trajectory, truth: &Trajectory) -> Result<Evaluation, EvaluationError> {
    crate::evaluation::evaluate(estimate, truth, STEP)
}

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
    if !evaluation.axes.are_as_given() {
        return Err(
            "covariances need an estimate and a ground truth with headings and the same axes"
                .into(),
        );
    }
    Ok(MatchedMotions::new(motions, truth, max_gap_ns)?)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use gyre_datasets::read_trajectory;
    use gyre_geometry::{Pose, pose};

    use super::*;

    const START_NS: i64 = 1_549_986_607_000_000_000;

    /// A drive of 100 s through bends, at `rate` Hz, by a clock that is late.
    fn drive(rate: f64, delay_s: f64) -> Trajectory {
        let (mut now, mut poses, mut stamps) = (Pose::identity(), Vec::new(), Vec::new());
        let steps = (100.0 * rate) as i64;
        for k in 0..steps {
            // Fine steps, so that the path does not depend on the rate.
            stamps.push(START_NS + ((k as f64 / rate + delay_s) * 1e9).round() as i64);
            poses.push(now);
            let fine = (1000.0 / rate) as i64;
            for part in 0..fine {
                let t = (k * fine + part) as f64 * 1e-3;
                let speed = 8.0 + 3.0 * (0.37 * t).sin() + 2.0 * (1.1 * t).cos();
                now *= pose(1e-3 * speed, 0.0, 1e-3 * 0.3 * (0.53 * t).sin());
            }
        }
        Trajectory::timed(stamps, poses)
    }

    fn ate_m(estimate: &Trajectory, truth: &Trajectory) -> f64 {
        let judged = judge(estimate, truth);
        judged.unwrap().ate.rmse_m
    }

    #[test]
    fn clocks_that_differ_are_found_and_the_offset_is_taken_out() {
        let estimate = drive(4.0, 0.0);
        for delay_s in [18.0, 37.0, -18.0, 1.6] {
            let mut truth = drive(10.0, delay_s);
            assert!(ate_m(&estimate, &truth) > 0.5);
            let found_s = take_time_offset_out(&estimate, &mut truth).unwrap();
            assert!((found_s - delay_s).abs() < 0.02, "{found_s}");
            assert!(ate_m(&estimate, &truth) < 0.1, "{delay_s}");
        }
        let mut standing = Trajectory {
            poses: vec![Pose::identity(); estimate.len()],
            ..estimate.clone()
        };
        let refused = take_time_offset_out(&estimate, &mut standing).unwrap_err();
        assert!(refused.to_string().contains("do not agree at any offset"));
    }

    /// A lidar's odometry of a drive of Boreas, in UTM, with roll and pitch.
    #[test]
    fn boreas_odometry_agrees_with_its_ground_truth() {
        let root = std::env::var_os("GYRE_DATA").map(PathBuf::from);
        let folder = root.map(|root| root.join("cases/boreas-truth"));
        let Some(folder) = folder.filter(|folder| folder.is_dir()) else {
            println!("skipped: GYRE_DATA has no cases/boreas-truth");
            return;
        };
        let read = |name| read_trajectory(&folder.join(name)).unwrap();
        let (truth, odometry) = (read("gps_poses.csv"), read("odometry.txt"));
        let evaluation = judge(&odometry, &truth).unwrap();
        let (ate_m, path_m) = (evaluation.ate.rmse_m, evaluation.path_m);
        assert!((0.030..0.035).contains(&ate_m), "{ate_m}");
        assert!((7_900.0..8_000.0).contains(&path_m), "{path_m}");
        assert!(!evaluation.axes.y_negated, "{}", evaluation.axes);
        // The lidar's x axis points to the right.
        let offset_deg = evaluation.heading_offset_deg.unwrap();
        assert!((-95.0..-85.0).contains(&offset_deg), "{offset_deg}");
    }
}
