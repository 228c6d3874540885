//! The trajectory corrected by loops: a function of the keyframes, the loops and the journal,
//! whenever loops were closed.

use std::fmt::{self, Write};

use gyre_configuration::{
    Configuration, gnss_log,
    terminal::{Failure, print},
};
use gyre_contract::flag;
use gyre_datasets::SampleLog;
use gyre_geometry::{Pose, xy_yaw};
use gyre_journal as journal;
use gyre_radar::Trajectory;
use gyre_slam::{
    Correction, Fixes, Keyframe, LoopOutcome, LoopVerdict, Query, RecordReader,
    TrajectoryEstimator,
    estimation::{Constraint, EstimationError},
    records_path,
};

use crate::{
    evaluation::{BandSample, Bands, LoopErrors, TruthSigma, loop_errors},
    out::Out,
    summary::{GnssSummary, SlamSummary},
};

/// Keyframes whose covariance is computed, at most: each takes a millisecond in a long drive.
const DRAWN: usize = 1000;

const HEADER: &str = "scan,found_scan,x_m,y_m,yaw_rad,similarity,correlation,searched,runner_up,chi_square,weight,verdict\n";

pub struct Slam {
    estimator: TrajectoryEstimator,
    correction: Correction,
    queries: Vec<Query>,
    keyframes: Vec<(u64, i64)>,
    gnss: Option<SampleLog>,
}

/// Checks that a run without keyframes has no poses either: the first one has a keyframe.
fn require_no_poses(out: &Out) -> Result<(), Failure> {
    let first = journal::poses(out.path())?.next().transpose()?;
    match first.is_some_and(|pose| !pose.item.is(flag::END)) {
        false => Ok(()),
        true => Err(format!(
            "{} has no keyframes, although the journal beside it has poses: restore it from a backup, or begin anew with --fresh",
            records_path::<Keyframe>(out.path()).display()
        )
        .into()),
    }
}

impl Slam {
    /// Corrects the poses of the keyframes of a run by its loops; `None` without SLAM, and before
    /// the first keyframe. For an unfinished run, the loops so far are left out.
    pub fn read(configuration: &Configuration, out: &Out) -> Result<Option<Self>, Failure> {
        let Some(kind) = configuration.slam.kind.estimator() else {
            return Ok(None);
        };
        let mut keyframes = RecordReader::<Keyframe>::open(out.path())?;
        if keyframes.is_empty() {
            return require_no_poses(out).map(|()| None);
        }
        let queries = queries(out)?;
        let gnss = gnss_log(configuration, out.path())?;
        let config = &configuration.gnss;
        let fixes = gnss.as_ref().map(|log| log.on_radar(config));
        let mut estimator = TrajectoryEstimator::new(kind)
            .with_fixes(Fixes::new(fixes.unwrap_or_default(), config));
        let mut known = Vec::new();
        for index in 0..keyframes.len() {
            // With its points, because the checksum covers the whole record.
            let keyframe = keyframes.read(index)?;
            estimator.push(&keyframe)?;
            known.push((keyframe.scan, keyframe.stamp_ns));
        }
        for query in &queries {
            check(query, known.len())?;
            estimator.close(query)?;
        }
        estimator.solve()?;
        Ok(Some(Self {
            correction: estimator.correction(),
            estimator,
            queries,
            keyframes: known,
            gnss,
        }))
    }

    pub fn correct(&self, seq: u64, pose: &Pose) -> Pose {
        self.correction.correct(seq, pose)
    }

    pub fn poses(&self) -> &[Pose] {
        self.estimator.poses()
    }

    /// Returns the corrected poses of both keyframes of each loop that is used.
    pub fn loops(&self) -> Vec<[Pose; 2]> {
        let ends = |it: Constraint| [it.from, it.to].map(|keyframe| self.poses()[keyframe]);
        self.used().map(ends).collect()
    }

    fn used(&self) -> impl Iterator<Item = Constraint> + '_ {
        let used = self.estimator.loops().iter();
        let used = used.filter(|it| it.verdict == LoopVerdict::Used);
        used.map(|it| it.constraint)
    }

    /// Returns `loops.csv`: a row for each verified candidate.
    pub fn loops_csv(&self) -> Result<String, fmt::Error> {
        let mut rows = HEADER.to_owned();
        let judged = self.estimator.loops();
        for query in &self.queries {
            for candidate in &query.candidates {
                let ends = (query.keyframe, candidate.place);
                let of = |it: &gyre_slam::JudgedLoop| (it.constraint.to, it.constraint.from);
                let judged = judged.binary_search_by_key(&ends, of).map(|at| judged[at]);
                let [query, place] = [ends.0, ends.1].map(|keyframe| self.keyframes[keyframe].0);
                let [x, y, yaw] = xy_yaw(&candidate.motion.motion);
                write!(rows, "{query},{place},{x:.4},{y:.4},{yaw:.6},")?;
                let scores = [
                    candidate.correlation,
                    candidate.searched,
                    candidate.runner_up,
                ];
                for figure in [candidate.similarity].into_iter().chain(scores) {
                    write!(rows, "{figure:.4},")?;
                }
                match candidate.chi_square.is_nan() {
                    true => write!(rows, ",")?,
                    false => write!(rows, "{:.3},", candidate.chi_square)?,
                }
                match judged {
                    Ok(judged) => writeln!(rows, "{:.4},{}", judged.weight, judged.verdict)?,
                    Err(_) => writeln!(rows, ",{}", unjudged(candidate.outcome))?,
                }
            }
        }
        Ok(rows)
    }

    /// Returns `graph.g2o`: the corrected keyframes, the motions between them, and the loops and
    /// fixes that are used.
    pub fn graph_g2o(&self) -> String {
        self.estimator.g2o()
    }

    /// Returns what became of the fixes of GNSS, and the place on the earth; `None` without them.
    pub fn gnss(&mut self) -> Result<Option<GnssSummary>, Failure> {
        let Some(log) = &self.gnss else {
            return Ok(None);
        };
        self.estimator.scale_covariances()?;
        let gnss = GnssSummary::of(log, &mut self.estimator)?;
        if let Some((refusal, false)) = gnss.refusal() {
            print::note(format_args!("the fixes of GNSS are not used: {refusal}"));
        }
        Ok(Some(gnss))
    }

    /// Returns the errors of the corrected keyframes with their standard deviations, relative to
    /// the first keyframe with a true pose.
    pub fn bands(&mut self, truth: &Trajectory) -> Result<Bands, Failure> {
        self.estimator.scale_covariances()?;
        let step = self.keyframes.len().div_ceil(DRAWN);
        let (mut samples, mut start) = (Vec::new(), None);
        for keyframe in (0..self.keyframes.len()).step_by(step) {
            let stamp_ns = self.keyframes[keyframe].1;
            let Some(truth) = truth.near(stamp_ns, Trajectory::ROUNDING_NS) else {
                continue;
            };
            let pose = self.estimator.pose(keyframe)?;
            let (map_from_truth, start_ns) =
                *start.get_or_insert((pose.motion * truth.inverse(), stamp_ns));
            let variances = pose.covariance.diagonal();
            samples.push(BandSample {
                time_s: (stamp_ns - start_ns) as f64 * 1e-9,
                error: pose.error(&(map_from_truth * truth)),
                sigma: variances.map(|variance| variance.max(0.0).sqrt()),
            });
        }
        Ok(Bands {
            chains: vec![samples],
            truth_sigma: TruthSigma::default(),
        })
    }

    pub fn errors_of(&self, trajectory: &Trajectory) -> Option<LoopErrors> {
        let at = |keyframe: usize| trajectory.at(self.keyframes[keyframe].1);
        loop_errors(self.used().filter_map(|it| {
            let by_trajectory = at(it.from)?.inv_mul(&at(it.to)?);
            Some((it.motion.motion, by_trajectory))
        }))
    }

    pub fn summary(&self) -> SlamSummary {
        let loops_used = self.used().count();
        let verified = |query: &Query| {
            let verified = [LoopOutcome::Accepted, LoopOutcome::ContradictsOdometry];
            let candidates = query.candidates.iter();
            candidates
                .filter(|it| verified.contains(&it.outcome))
                .count()
        };
        SlamSummary {
            keyframes: self.keyframes.len(),
            loops_used,
            loops_rejected: self.queries.iter().map(verified).sum::<usize>() - loops_used,
            ..SlamSummary::default()
        }
    }
}

/// Returns the verdict on a candidate that the trajectory was not given.
fn unjudged(outcome: LoopOutcome) -> &'static str {
    match outcome {
        LoopOutcome::Accepted => "not judged",
        LoopOutcome::LowCorrelation => "low correlation",
        LoopOutcome::Ambiguous => "ambiguous",
        LoopOutcome::Undetermined => "undetermined",
        LoopOutcome::ContradictsOdometry => "contradicts odometry",
    }
}

/// Refuses a query of keyframes that the run does not have: its log belongs to other keyframes.
fn check(query: &Query, keyframes: usize) -> Result<(), EstimationError> {
    let to = query.keyframe;
    let places = query.candidates.iter().map(|candidate| candidate.place);
    let from = places.max().unwrap_or(to);
    match from.max(to) < keyframes {
        true => Ok(()),
        false => Err(EstimationError::unknown([from, to], keyframes)),
    }
}

/// Reads the candidates of all keyframes, if all of them have been queried.
fn queries(out: &Out) -> Result<Vec<Query>, Failure> {
    let mut queries = RecordReader::open(out.path())?;
    if !queries.has_ended() {
        return Ok(Vec::new());
    }
    let all = 0..queries.len();
    Ok(all
        .map(|index| queries.read(index))
        .collect::<Result<_, _>>()?)
}
