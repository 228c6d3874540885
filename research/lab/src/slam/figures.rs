//! The measures of loops and of a corrected trajectory.

use std::{collections::BTreeMap, time::Duration};

use gyre_geometry::UncertainMotion;
use gyre_radar::Trajectory;
use gyre_results::judgement::judge;
use gyre_slam::{LoopCandidate, Query, TrajectoryEstimator};
use gyre_configuration::terminal::Failure;
use serde_json::json;

use crate::{
    drive::Drive,
    report::{Record, Table, record},
};

/// Keyframes within this distance of an earlier one are revisits, m.
const NEAR_M: f64 = 5.0;
/// A loop is wrong if its yaw is off by more.
const WRONG_DEG: f64 = 5.0;
/// The share of the path before a keyframe that is not compared with it, m.
const GAP_M: f64 = 100.0;

/// The figures of a trajectory.
pub struct Figures {
    ate_m: f64,
    /// Loops, and those among them that are rejected or that the kernel leaves less than a quarter
    /// of their weight.
    loops: [usize; 2],
    residual_m: Option<f64>,
    /// NEES of the keyframes' poses, of the whole pose, over its expectation.
    nees: f64,
    /// Factor of the covariances by the residuals.
    scale: Option<f64>,
    solved: Duration,
}

impl Figures {
    pub fn before(drive: &Drive) -> Result<Self, Failure> {
        let poses: Vec<_> = drive.keyframes.iter().map(|it| it.pose).collect();
        Ok(Self {
            ate_m: ate_m(drive, &drive.estimate)?,
            loops: [0; 2],
            residual_m: None,
            nees: nees(drive, &poses),
            scale: None,
            solved: Duration::ZERO,
        })
    }

    pub fn after(
        drive: &Drive,
        estimator: &mut TrajectoryEstimator,
        solved: Duration,
    ) -> Result<Self, Failure> {
        let correction = estimator.correction();
        let corrected = (0..).zip(&drive.estimate.poses);
        let corrected = Trajectory {
            poses: corrected
                .map(|(seq, pose)| correction.correct(seq, pose))
                .collect(),
            ..drive.estimate.clone()
        };
        let scale = estimator.scale_covariances()?;
        let keyframes = 0..drive.keyframes.len();
        let poses: Result<Vec<_>, _> = keyframes.map(|k| estimator.pose(k)).collect();
        let weak = |weight: f64| weight < 0.25;
        let loops = estimator.loops();
        let squares = loops.iter().filter(|it| !weak(it.weight)).map(|it| {
            let [from, to] = [it.constraint.from, it.constraint.to].map(|k| estimator.poses()[k]);
            let error = it.constraint.motion.error(&from.inv_mul(&to));
            error.xy().norm_squared()
        });
        let squares: Vec<f64> = squares.collect();
        Ok(Self {
            ate_m: ate_m(drive, &corrected)?,
            loops: [
                loops.len(),
                loops.iter().filter(|it| weak(it.weight)).count(),
            ],
            residual_m: Some((squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()),
            nees: nees(drive, &poses?),
            scale: Some(scale),
            solved,
        })
    }

    pub fn row(&self, name: &str) -> Record {
        record(json!({
            "trajectory": name, "ate_m": self.ate_m, "loops": self.loops[0], "weak": self.loops[1],
            "residual_m": self.residual_m, "nees": self.nees, "scale": self.scale, "solved_ms": self.solved.as_secs_f64() * 1e3,
        }))
    }
}

pub fn table(rows: Vec<Record>) -> Table {
    Table {
        title: "Trajectory".to_owned(),
        columns: vec![
            ("trajectory", "trajectory", 0),
            ("ate_m", "ATE m", 2),
            ("loops", "loops", 0),
            ("weak", "rejected or below 1/4 weight", 0),
            ("residual_m", "residual rms m", 3),
            ("nees", "NEES", 2),
            ("scale", "scale of covariances", 2),
            ("solved_ms", "solved in ms", 0),
        ],
        rows,
        legend: "NEES over its expectation, of the poses of keyframes against the first one, with scaled covariances."
            .to_owned(),
        ..Table::default()
    }
}

fn ate_m(drive: &Drive, trajectory: &Trajectory) -> Result<f64, Failure> {
    Ok(judge(trajectory, &drive.truth)?.ate.rmse_m)
}

/// The mean NEES of poses in the frame of the first one, over its expectation.
fn nees(drive: &Drive, poses: &[UncertainMotion]) -> f64 {
    let known = |k: usize| drive.truths[k].map(|truth| (poses[k], truth));
    let Some(start) = (0..poses.len()).find_map(known) else {
        return f64::NAN;
    };
    let frame = start.0.motion * start.1.inverse();
    let values = (1..poses.len())
        .filter_map(known)
        .filter_map(|(pose, truth)| {
            let error = pose.error(&(frame * truth));
            Some(error.dot(&(pose.covariance.try_inverse()? * error)) / 3.0)
        });
    let values: Vec<f64> = values.collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// The loops of all queries against the truth.
#[derive(Default)]
struct LoopCounts {
    right: usize,
    wrong: usize,
    /// Keyframes near an earlier one, and those of them with a right loop.
    revisits: usize,
    closed: usize,
    outcomes: BTreeMap<String, usize>,
}

impl LoopCounts {
    fn add(&mut self, drive: &Drive, query: &Query, wrong_m: f64) {
        for candidate in &query.candidates {
            let outcome = format!("{:?}", candidate.outcome);
            *self.outcomes.entry(outcome).or_default() += 1;
        }
        let mut is_closed = false;
        for (candidate, _) in query.loops() {
            match is_wrong(drive, query.keyframe, candidate, wrong_m) {
                Some(true) => self.wrong += 1,
                Some(false) => {
                    self.right += 1;
                    is_closed = true;
                }
                None => {}
            }
        }
        if is_revisit(drive, query.keyframe) {
            self.revisits += 1;
            self.closed += usize::from(is_closed);
        }
    }
}

/// Returns whether a loop contradicts the truth; `None` where that is unknown.
fn is_wrong(drive: &Drive, later: usize, found: &LoopCandidate, wrong_m: f64) -> Option<bool> {
    let (later, earlier) = (drive.truths[later]?, drive.truths[found.place]?);
    let error = found.motion.error(&earlier.inv_mul(&later));
    Some(error.xy().norm() > wrong_m || error.z.abs() > WRONG_DEG.to_radians())
}

fn is_revisit(drive: &Drive, keyframe: usize) -> bool {
    let until_m = drive.path_m[keyframe] - GAP_M;
    let eligible = drive.path_m.partition_point(|at| *at <= until_m);
    (0..eligible).any(|place| drive.true_distance_m(keyframe, place) < NEAR_M)
}

/// The loops against the truth.
pub fn loops_table(drive: &Drive, queries: &[Query], wrong_m: f64, closing: Duration) -> Table {
    let mut counts = LoopCounts::default();
    for query in queries {
        counts.add(drive, query, wrong_m);
    }
    let row = json!({
        "right": counts.right, "wrong": counts.wrong, "revisits": counts.revisits,
        "recall": 100.0 * counts.closed as f64 / counts.revisits.max(1) as f64,
    });
    Table {
        title: "Loops".to_owned(),
        columns: vec![
            ("right", "right", 0),
            ("wrong", "wrong", 0),
            ("revisits", "revisits within 5 m", 0),
            ("recall", "recall %", 1),
        ],
        rows: vec![record(row)],
        legend: format!(
            "{} keyframes; candidates by verdict: {:?}; closed in {:.1} s.",
            queries.len(),
            counts.outcomes,
            closing.as_secs_f64()
        ),
        ..Table::default()
    }
}
