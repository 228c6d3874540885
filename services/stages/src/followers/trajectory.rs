//! The trajectory that agrees with the loops: follows `journal/keyframes.log` and
//! `journal/loops.log`, and the fixes of GNSS, which for a live receiver come on `gnss`. New loops
//! and fixes update the standing estimate; when both logs have ended, the poses are solved again,
//! so that the last correction equals the results.

mod live_fixes;

use std::{mem, path::Path};

use gyre_contract::{
    Correction, CorrectionHeader, Item,
    run::{SourceConfig, StageCounters},
};
use gyre_geometry::{UncertainMotion, covariance, samples::GnssConfig, xy_yaw};
use gyre_slam::{
    EstimatorKind, Fixes, Keyframe, LoopVerdict, Query, RecordReader, SlamConfig,
    TrajectoryEstimator,
};
use gyre_stage::{
    Follower, Launch,
    follower::{self, Progress, Step},
};
use gyre_transport::{RunError, services::LogId};
use live_fixes::LiveFixes;

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let slam: SlamConfig = launch.section("slam")?;
    let kind = slam.kind.estimator().ok_or_else(|| {
        RunError::Input("slam.kind is none: there is no trajectory to correct".to_owned())
    })?;
    let manifest = &launch.manifest;
    let config: GnssConfig = launch.section("gnss")?;
    let mut trajectory = Trajectory::open(&manifest.out, kind, fixes(launch, &config)?)?;
    let is_over = trajectory.keyframes.has_ended() && !LiveFixes::have_begun(manifest);
    if config.is_live() && !is_over {
        trajectory.live_fixes = Some(LiveFixes::open(config, &launch.node, manifest)?);
    }
    follower::run(launch, &mut trajectory)
}

/// Returns the fixes of GNSS that are known by now; none without `[gnss]`.
fn fixes(launch: &Launch, config: &GnssConfig) -> Result<Fixes, RunError> {
    let source: SourceConfig = launch.section("source")?;
    let out = &launch.manifest.out;
    let log = gyre_recording::gnss_log(config, &source.data, out).map_err(RunError::input)?;
    let fixes = log.map(|log| log.on_radar(config)).unwrap_or_default();
    Ok(Fixes::new(fixes, config))
}

struct Trajectory {
    kind: EstimatorKind,
    /// The fixes that are later than all keyframes.
    fixes: Fixes,
    live_fixes: Option<LiveFixes>,
    keyframes: RecordReader<Keyframe>,
    queries: RecordReader<Query>,
    estimator: TrajectoryEstimator,
    newest: Option<Keyframe>,
    read: [usize; 2],
    /// The pose of the newest keyframe as corrected; `None` if loops were read since that have
    /// corrected no pose yet.
    corrected: Option<UncertainMotion>,
    /// True if the poses equal the results.
    is_final: bool,
    has_changed: bool,
}

impl Trajectory {
    fn open(out: &Path, kind: EstimatorKind, fixes: Fixes) -> Result<Self, RunError> {
        Ok(Self {
            kind,
            keyframes: RecordReader::open(out)?,
            queries: RecordReader::open(out)?,
            estimator: TrajectoryEstimator::new(kind).with_fixes(fixes.clone()),
            fixes,
            live_fixes: None,
            newest: None,
            read: [0, 0],
            corrected: None,
            is_final: false,
            has_changed: false,
        })
    }

    /// Looks for new records. If some of the records that were read have been cut off, it restarts
    /// from the first record.
    fn look(&mut self) -> Result<(), RunError> {
        self.keyframes.refresh()?;
        self.queries.refresh()?;
        let unchanged = [self.keyframes.unchanged(), self.queries.unchanged()];
        let mut read = self.read.iter().zip(unchanged);
        if read.any(|(read, unchanged)| unchanged < *read) {
            self.estimator = TrajectoryEstimator::new(self.kind).with_fixes(self.fixes.clone());
            (self.newest, self.corrected, self.read) = (None, None, [0, 0]);
            (self.is_final, self.has_changed) = (false, false);
        }
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, RunError> {
        let [keyframes, queries] = self.read;
        if keyframes < self.keyframes.len() {
            let keyframe = Keyframe::without_points(&mut self.keyframes, keyframes)?;
            let fixes = self.estimator.fixes().settled();
            self.estimator.push(&keyframe).map_err(RunError::input)?;
            // Without a new loop or fix the poses before stay where they are.
            let standing = self.corrected.map(|last| last.then(&keyframe.motion));
            self.corrected = standing.filter(|_| self.estimator.fixes().settled() == fixes);
            self.newest = Some(keyframe);
            self.read[0] += 1;
        } else if queries < self.queries.len() {
            let query = self.queries.read(queries)?;
            if query.keyframe >= keyframes {
                // Its keyframe has been cut off, and the query will be.
                return Ok(false);
            }
            if query.loops().next().is_some() {
                self.corrected = None;
            }
            self.estimator.close(&query).map_err(RunError::input)?;
            self.read[1] += 1;
        } else {
            return Ok(false);
        }
        self.has_changed = true;
        Ok(true)
    }

    /// Uses the fixes that have arrived; at the end of the run all of them.
    fn take_live_fixes(&mut self) -> Result<(), RunError> {
        let Some(live) = &mut self.live_fixes else {
            return Ok(());
        };
        if let Some(fixes) = live.examine(self.is_final)? {
            self.fixes = fixes.clone();
            if self.estimator.replace_fixes(fixes) {
                self.corrected = None;
            }
        }
        Ok(())
    }

    fn correct(&mut self) -> Result<Option<CorrectionHeader>, RunError> {
        let Some(newest) = &self.newest else {
            return Ok(None);
        };
        let [keyframes, queries] = self.read;
        let corrected = match self.corrected {
            Some(corrected) => corrected,
            None => {
                match self.is_final {
                    true => self.estimator.solve().map_err(RunError::input)?,
                    false => self.estimator.update().map_err(RunError::input)?,
                }
                self.estimator
                    .pose(keyframes - 1)
                    .map_err(RunError::input)?
            }
        };
        self.corrected = Some(corrected);
        let loops = self.estimator.loops().iter();
        let used = loops.filter(|it| it.verdict == LoopVerdict::Used);
        let map_from_odometry = corrected.motion * newest.pose.motion.inverse();
        let [x_m, y_m, yaw_rad] = xy_yaw(&map_from_odometry);
        let seq = (keyframes + queries + usize::from(self.is_final)) as u64 - 1;
        Ok(Some(CorrectionHeader {
            item: Item::recorded(seq, newest.scan, newest.stamp_ns),
            keyframe_seq: newest.seq,
            keyframes: keyframes as u64,
            loops: used.count() as u64,
            x_m,
            y_m,
            yaw_rad,
            keyframe_covariance: covariance::pack(&corrected.covariance),
        }))
    }
}

impl Follower for Trajectory {
    type Output = Correction;
    const LOGS: &'static [LogId] = &[LogId::Keyframes, LogId::Loops];

    fn step(&mut self) -> Result<Step<CorrectionHeader>, RunError> {
        self.live_fixes.iter_mut().try_for_each(LiveFixes::take)?;
        if self.advance()? {
            return Ok(Step::Worked(None));
        }
        self.look()?;
        if self.advance()? {
            return Ok(Step::Worked(None));
        }
        // The queries end after the keyframes.
        let has_ended = self.queries.has_ended() && self.keyframes.has_ended();
        if has_ended && !self.is_final {
            (self.has_changed, self.corrected) = (true, None);
        }
        self.is_final = has_ended;
        if mem::take(&mut self.has_changed) {
            self.take_live_fixes()?;
            return Ok(Step::Worked(self.correct()?));
        }
        Ok(match has_ended {
            true => Step::Ended,
            false => Step::Idle,
        })
    }

    fn sync(&mut self) -> Result<(), RunError> {
        self.live_fixes.iter_mut().try_for_each(LiveFixes::finish)
    }

    fn progress(&self) -> Progress {
        Progress::of(self.read[1], self.keyframes.len())
    }
}

#[cfg(test)]
mod tests;
